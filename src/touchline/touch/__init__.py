# SPDX-License-Identifier: Apache-2.0
"""The arm as an interface: widgets, gestures and handwriting on its surface."""

from touchline.touch.recognizer import Recognizer
from touchline.touch.stroke import Stroke
from touchline.touch.touch import Touch, TouchEvent

__all__ = ["Recognizer", "Stroke", "Touch", "TouchEvent"]
