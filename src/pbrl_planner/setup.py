from setuptools import find_packages, setup

NAME = "pbrl_planner"

setup(
    name=NAME,
    version="0.1.0",
    description="Planners: kinodynamic RRT on learned physics; lattice of a robot with a cart, and its nodes.",
    license="BSD-3-Clause",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["numba", "numpy", "ompl", "opencv-python-headless", "pydantic", "scipy", "shapely"],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "costmap_node = pbrl_planner.ros.costmap_node:main",
            "lattice_planner_node = pbrl_planner.ros.lattice_planner_node:main",
            "cart_controller_node = pbrl_planner.ros.cart_controller_node:main",
            "cart_navigator_node = pbrl_planner.ros.cart_navigator_node:main",
            "tabletop_node = pbrl_planner.ros.tabletop_node:main",
        ],
    },
)
