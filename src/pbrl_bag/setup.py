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
    python_requires=">=3.11",
    install_requires=[
        "apsw>=3.45",
        "lz4>=4.3",
        "mcap>=1.2",
        "mcap-ros2-support>=0.5.5",
        "numpy>=1.26",
        "pydantic>=2.6",
        "pyyaml>=6.0",
        "rosbags>=0.10",
        "scipy>=1.12",
        "zstandard>=0.22",
    ],
    extras_require={"efforts": ["pin>=2.7"]},  # a wrench out of joint efforts
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "recorder_node = pbrl_bag.ros.recorder_node:main",
            "player_node = pbrl_bag.ros.player_node:main",
        ],
    },
)
