"""Installs snake_control as an ament_python package: `colcon build` calls this."""

from glob import glob

from setuptools import find_packages, setup

NAME = "snake_control"
NODES = (
    "bus_driver",
    "pose_input",
    "scp_controller",
    "trajectory_generator",
    "keyboard_teleop",
    "description",
    "record",
    "head_trajectory",
    "mock_bus",
)
COMMANDS = ("demo", "evaluate", "experiment", "layouts", "recording", "scp_study")

setup(
    name=NAME,
    version="0.1.0",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["experiment/*.j2"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", sorted(glob("config/*.yaml") + glob("config/*.rviz"))),
        (f"share/{NAME}/config/layouts", sorted(glob("config/layouts/*"))),
        (f"share/{NAME}/config/trajectories", sorted(glob("config/trajectories/*"))),
        (f"share/{NAME}/launch", sorted(glob("launch/*.launch.py"))),
    ],
    install_requires=["setuptools"],
    # Tells `colcon test` to run pytest.
    extras_require={"test": ["pytest"]},
    zip_safe=True,
    maintainer="snake_control maintainers",
    maintainer_email="maintainers@snake-control.invalid",
    description="Controller for head raising wheeled snake robots with AX-12 servos.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            *(f"{node} = {NAME}.nodes.{node}:main" for node in NODES),
            *(f"{command} = {NAME}.cli.{command}:main" for command in COMMANDS),
            f"ax12 = {NAME}.cli.ax12.__main__:main",
        ],
    },
)
