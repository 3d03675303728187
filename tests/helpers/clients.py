"""Clients of PyBullet in this process."""

import pybullet


def open_clients():
    """Numbers of the clients that are open; there are 1024 at most."""
    return [client for client in range(1024) if pybullet.isConnected(physicsClientId=client)]
