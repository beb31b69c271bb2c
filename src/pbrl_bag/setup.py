from setuptools import find_packages, setup

NAME = "pbrl_bag"

setup(
    name=NAME,
    version="0.1.0",
    description="Recordings: the MCAP contract, bags in and out, episodes; recorder and player nodes.",
    license="BSD-3-Clause",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=[
        "numpy",
        "pydantic",
        "pyyaml",
        "mcap",
        "mcap-ros2-support",
        "scipy",
        "zstandard",
        "lz4",
        "rosbags",
        "apsw",
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "recorder_node = pbrl_bag.ros.recorder_node:main",
            "player_node = pbrl_bag.ros.player_node:main",
        ],
    },
)
