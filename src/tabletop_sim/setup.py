from setuptools import find_packages, setup

NAME = "tabletop_sim"

setup(
    name=NAME,
    version="0.1.0",
    description="A table with items and an arm that pushes them, in Bullet; sim_node.",
    license="BSD-3-Clause",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["numpy", "pybullet"],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "sim_node = tabletop_sim.ros.sim_node:main",
        ],
    },
)
