from setuptools import find_packages, setup

NAME = "pbrl_bringup"

setup(
    name=NAME,
    version="0.1.0",
    description="Command line, demo, benches and the web page of reports.",
    license="BSD-3-Clause",
    packages=find_packages(),
    package_data={NAME: ["py.typed", "templates/*", "benches/*.mjs"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=[
        *("typer", "rich", "jinja2", "psutil", "pydantic", "numpy", "starlette", "uvicorn", "dask", "distributed"),
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "pbrl = pbrl_bringup.cli.app:main",
        ],
    },
)
