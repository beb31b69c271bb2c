from setuptools import find_packages, setup

NAME = "pr2_cart_sim"

setup(
    name=NAME,
    version="0.1.0",
    description="PR2 with a utility cart among people in an office, in Bullet; sim_node.",
    license="BSD-3-Clause",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["numpy", "opencv-python-headless", "pybullet", "pydantic", "pyyaml", "shapely"],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "sim_node = pr2_cart_sim.ros.sim_node:main",
            "make_office = pr2_cart_sim.make_office:main",
        ],
    },
)
