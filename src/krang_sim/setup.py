from setuptools import find_packages, setup

NAME = "krang_sim"

setup(
    name=NAME,
    version="0.1.0",
    description="Golem Krang in Bullet, with furniture on casters; sim_node.",
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
            "sim_node = krang_sim.ros.sim_node:main",
            "hand_node = krang_sim.ros.hand_node:main",
        ],
    },
)
