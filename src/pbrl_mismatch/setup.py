from setuptools import find_packages, setup

NAME = "pbrl_mismatch"

setup(
    name=NAME,
    version="0.1.0",
    description="Where simulation and recording part, why, and the repaired model; mismatch_node.",
    license="BSD-3-Clause",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    python_requires=">=3.11",
    install_requires=[
        "pbrl_bag",
        "pbrl_model",
        "numba>=0.60",
        "numpy>=1.26",
        "pydantic>=2.6",
        "scipy>=1.12",
        "shapely>=2.0.3",
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "mismatch_node = pbrl_mismatch.ros.mismatch_node:main",
        ],
    },
)
