from setuptools import find_packages, setup

NAME = "pbrl_model"

setup(
    name=NAME,
    version="0.1.0",
    description="The world model: pymunk world, compiled kernel, priors, likelihood, inference; model_node.",
    license="BSD-3-Clause",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=[
        "numpy",
        "scipy",
        "numba",
        "pymunk",
        "shapely",
        "arviz",
        "pydantic",
        "pyyaml",
        "h5netcdf",
        "opencv-python-headless",
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "model_node = pbrl_model.ros.model_node:main",
            "tag_detector_node = pbrl_model.ros.tag_detector_node:main",
        ],
    },
)
