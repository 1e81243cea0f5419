# SPDX-License-Identifier: Apache-2.0
"""Functions of ROS 2's C library, for native threads that take and publish messages."""

import ctypes
from dataclasses import dataclass
from typing import Any

from touchline.errors import InputError

LIBRARY = "librcl.so"


@dataclass(frozen=True)
class Rcl:
    """Addresses of functions of rcl, as rcl/subscription.h and rcl/publisher.h declare them.

    Attributes:
        take: `rcl_take_serialized_message`.
        set_on_new: `rcl_subscription_set_on_new_message_callback`.
        publish: `rcl_publish_serialized_message`.
    """

    take: int
    set_on_new: int
    publish: int


def find_rcl() -> Rcl:
    """Those of the library that rclpy has loaded; to be called after it was imported.

    Raises:
        InputError: it has them not: ROS 2 is older than Humble.
    """
    try:
        library = ctypes.CDLL(LIBRARY)
        return Rcl(
            address(library.rcl_take_serialized_message),
            address(library.rcl_subscription_set_on_new_message_callback),
            address(library.rcl_publish_serialized_message),
        )
    except (OSError, AttributeError) as error:
        raise InputError(f"ROS 2 Humble or later is needed: {error}") from None


def address(function: Any) -> int:
    """Where a C function stands."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0
