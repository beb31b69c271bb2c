from setuptools import find_packages, setup

NAME = "pbrl_namo"

setup(
    name=NAME,
    version="0.1.0",
    description="Navigation among movable obstacles whose physics is not known; namo_node.",
    license="BSD-3-Clause",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["numba", "numpy", "ompl", "pydantic", "pyyaml", "scipy", "shapely"],
    zip_safe=False,
    entry_points={"console_scripts": ["namo_node = pbrl_namo.ros.namo_node:main"]},
)
