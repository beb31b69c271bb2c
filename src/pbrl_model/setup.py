from setuptools import find_packages, setup

NAME = "pbrl_model"

setup(
    name=NAME,
    version="0.1.0",
    description="The world model: pymunk world, compiled kernel, priors, likelihood, inference; model_node.",
    license="BSD-3-Clause",
    packages=find_packages(),
    package_data={NAME: ["py.typed", "*.json"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    python_requires=">=3.11",
    install_requires=[
        "pbrl_bag",
        "arviz>=0.18,<1",
        "h5netcdf>=1.3",
        "llvmlite>=0.43",
        "numba>=0.60",
        "numpy>=1.26",
        "opencv-python-headless>=4.9",
        "pydantic>=2.6",
        "pymunk>=7.0",
        "scipy>=1.12",
        "shapely>=2.0.3",
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "model_node = pbrl_model.ros.model_node:main",
            "tag_detector_node = pbrl_model.ros.tag_detector_node:main",
        ],
    },
)
