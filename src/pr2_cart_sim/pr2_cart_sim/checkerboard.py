"""The cart's checkerboard in the picture of the head's camera: drawn, rendered, found with OpenCV, solved for.

What renders the room's tags renders it: only the rectangle around the board, with everything that stands in the way.
"""

from __future__ import annotations

import math
import tempfile
from collections import deque
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bullet_sim.camera_settings import CameraSettings
from bullet_sim.cameras import Camera
from bullet_sim.client import BulletClient, Pose, multiply
from bullet_sim.errors import SimError
from bullet_sim.photographer import Photographer
from bullet_sim.quiet import bullet
from bullet_sim.sensors import SLACK, Ticker
from pr2_cart_sim.observations import CartReading
from pr2_cart_sim.sensor_settings import BoardSettings

Array = NDArray[np.float64]

TEXELS = 40
"""Of the texture along each side of a square."""
QUIET = 1
"""White squares around the pattern."""


def board_image(settings: BoardSettings) -> NDArray[np.uint8]:
    """Draw the board with its white margin, grey levels, the upper edge first."""
    across, down = settings.columns + 1, settings.rows + 1
    dark = (np.add.outer(np.arange(down), np.arange(across)) % 2 == 0).astype(np.uint8)
    cells = np.pad(255 * (1 - dark), QUIET, constant_values=255).astype(np.uint8)
    return np.kron(cells, np.ones((TEXELS, TEXELS), np.uint8))


def board_mount(settings: BoardSettings) -> Pose:
    """Give the board in the cart's frame: x to its right as the robot sees it, y up, z out of it towards the robot."""
    lean = settings.tilt
    right, up = np.array([0.0, -1.0, 0.0]), np.array([math.sin(lean), 0.0, math.cos(lean)])
    turn = Rotation.from_matrix(np.column_stack([right, up, np.cross(right, up)]))
    return Pose(np.array(settings.position), turn.as_quat())


class _BoardPlate:
    """The board in Bullet: a textured plate without mass that nothing can touch."""

    def __init__(self, client: BulletClient, settings: BoardSettings) -> None:
        across, down = settings.columns + 1 + 2 * QUIET, settings.rows + 1 + 2 * QUIET
        self._half = x, y = across * settings.square / 2, down * settings.square / 2
        self._api = client.api
        shape = self._api.createVisualShape(
            bullet.GEOM_MESH,
            vertices=[[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]],
            indices=[0, 1, 2, 0, 2, 3],
            uvs=[[0, 0], [1, 0], [1, 1], [0, 1]],
            normals=[[0, 0, 1]] * 4,
            rgbaColor=[1, 1, 1, 1],
        )
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "checkerboard.png"
            cv2.imwrite(str(file), cv2.cvtColor(board_image(settings), cv2.COLOR_GRAY2BGR))
            texture = self._api.loadTexture(str(file))
            if texture < 0:
                raise SimError("checkerboard: expected Bullet to read its texture; check the temporary folder")
            self._body = int(self._api.createMultiBody(baseMass=0, baseVisualShapeIndex=shape))
            self._api.changeVisualShape(self._body, -1, textureUniqueId=texture)
        self.pose = Pose(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))

    def move(self, pose: Pose) -> None:
        """Put the plate somewhere in `world`."""
        self.pose = pose
        self._api.resetBasePositionAndOrientation(self._body, pose.position.tolist(), pose.quaternion.tolist())

    def outlines(self) -> list[tuple[Pose, Array]]:
        """Give its pose and its corners (4, 3) [m] in `world`, as a photographer asks for them."""
        x, y = self._half
        local = np.array([[-x, y, 0], [x, y, 0], [x, -y, 0], [-x, -y, 0]])
        return [(self.pose, self.pose.position + local @ self.pose.matrix.T)]


class BoardCamera:
    """The head's camera and who looks at its pictures."""

    def __init__(self, client: BulletClient, settings: BoardSettings, cart: str, rng: Generator) -> None:
        """Glue the board on, and draw the calibration's error from `rng`, which is kept for the noise.

        Raises:
            SimError: Bullet cannot read the board's texture.
        """
        draws, noise = rng.spawn(2)
        self._settings, self._cart = settings, cart
        self._mount, self._plate = board_mount(settings), _BoardPlate(client, settings)
        camera = CameraSettings(
            width=settings.width, lines=settings.lines, noise=settings.pixel_noise, distortion=(0, 0, 0, 0, 0)
        )
        self._photographer = Photographer(client, (), self._plate, camera, noise)
        focal = settings.width / 2 / math.tan(settings.field_of_view / 2)
        middle = (settings.width - 1) / 2, (settings.lines - 1) / 2
        self._matrix = np.array([[focal, 0, middle[0]], [0, focal, middle[1]], [0, 0, 1.0]])
        self._ticker = Ticker(settings.rate)
        self._underway: deque[tuple[float, CartReading]] = deque()
        size = settings.bias / 2  # of where the camera is taken to be; the board is about a metre away
        self._off = Pose(draws.uniform(-size, size, 3), Rotation.from_rotvec(draws.uniform(-size, size, 3)).as_quat())

    def due(self, time: float) -> bool:
        """Say whether a picture is taken at this step; if so, call `capture`."""
        return self._ticker.due(time)

    def capture(self, time: float, camera: Pose, cart: Pose, base: Pose) -> None:
        """Take a picture and look for the board in it.

        Args:
            time: now [s].
            camera: the true optical frame in `world`.
            cart: its true pose.
            base: of the robot; readings are in it.
        """
        self._plate.move(Pose(cart.point(self._mount.position), multiply(cart.quaternion, self._mount.quaternion)))
        told = Pose(camera.point(self._off.position), multiply(camera.quaternion, self._off.quaternion))
        settings = self._settings
        view = Camera(0, settings.width, settings.lines, self._matrix, np.zeros(5), camera, told)
        self._photographer.cameras = (view,)
        found = find_board(self._photographer.take()[0], self._matrix, settings)
        if found is None:
            return
        turn, place = found
        board = told.matrix @ turn
        in_world = told.point(place) - board @ self._mount.matrix.T @ self._mount.position
        frame = board @ self._mount.matrix.T
        yaw = math.atan2(frame[1, 0], frame[0, 0]) - base.yaw
        x, y, _ = base.inverse_point(in_world)
        pose = np.array([x, y, (yaw + math.pi) % (2 * math.pi) - math.pi])
        self._underway.append((time + settings.latency, CartReading(time, "checkerboard", self._cart, pose, math.nan)))

    def deliver(self, time: float) -> list[CartReading]:
        """Give the readings whose latency has passed, oldest first."""
        arrived = []
        while self._underway and self._underway[0][0] <= time + SLACK:
            arrived.append(self._underway.popleft()[1])
        return arrived


def find_board(
    image: NDArray[np.uint8], matrix: Array | Sequence[Sequence[float]], settings: BoardSettings
) -> tuple[Array, Array] | None:
    """Find the board in a picture.

    Args:
        image: (lines, width) grey levels, of a lens without distortion.
        matrix: (3, 3) of the lens [px].
        settings: what the board is like.

    Returns:
        Rotation (3, 3) and place (3,) [m] of the board in the camera's optical frame; None where it is not seen.
    """
    # The one that looks for sectors: the older one, which looks for quadrangles, misses squares below some 20 px.
    found, corners = cv2.findChessboardCornersSB(image, (settings.columns, settings.rows))
    if not found:
        return None
    if corners[0, 0, 1] > corners[-1, 0, 1]:  # found upside down: nobody carries a cart so
        corners = corners[::-1]
    columns, rows = np.meshgrid(np.arange(settings.columns), np.arange(settings.rows))
    x = (columns - (settings.columns - 1) / 2) * settings.square
    y = ((settings.rows - 1) / 2 - rows) * settings.square
    points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    solved, turn, place = cv2.solvePnP(points, corners, np.asarray(matrix), np.zeros(5), flags=cv2.SOLVEPNP_ITERATIVE)
    if not solved:
        return None
    return np.array(cv2.Rodrigues(turn)[0], dtype=float), np.array(place[:, 0], dtype=float)
