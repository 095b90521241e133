"""Values leave the house: events of the store to MQTT brokers, and an OPC UA server that plants read."""

from threadpitch.publish.errors import PublishError
from threadpitch.publish.outlets import Outlet, outlets, wait_until_taken

__all__ = ["Outlet", "PublishError", "outlets", "wait_until_taken"]
