from setuptools import find_packages, setup

NAME = "bullet_sim"

setup(
    name=NAME,
    version="0.1.0",
    description="What the simulators share: Bullet client, scene, casters, grip, sensors, concealed effects.",
    license="BSD-3-Clause",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    install_requires=["numpy", "opencv-python-headless", "pybullet", "pydantic", "pyyaml", "scipy", "shapely"],
    zip_safe=False,
)
