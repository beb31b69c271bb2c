from setuptools import find_packages, setup

NAME = "pbrl_control"

setup(
    name=NAME,
    version="0.1.0",
    description="Whole-body control of what the robot holds; body_controller_node and push_node.",
    license="BSD-3-Clause",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=[
        "daqp",
        "numba",
        "numpy",
        "ompl",
        "opencv-python-headless",
        "pin",
        "pydantic",
        "pyyaml",
        "scipy",
        "shapely",
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "body_controller_node = pbrl_control.ros.body_controller_node:main",
            "push_node = pbrl_control.ros.push_node:main",
        ],
    },
)
