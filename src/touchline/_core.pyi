from collections.abc import Sequence
import enum
from typing import Annotated

import numpy
import numpy.typing
from numpy.typing import NDArray


class NodeKind(enum.Enum):
    fixed = 0

    revolute = 1

    prismatic = 2

class Torque(enum.Enum):
    sensor = 0

    motor = 1

    none = 2

    from_sensors = 3

class Compensated(enum.Enum):
    none = 0

    gravity = 1

    model = 2

class Method(enum.Enum):
    segment = 0

    paper = 1

class Discretization(enum.Enum):
    automatic = 0

    tustin = 1

    exponential = 2

class Node:
    @property
    def parent(self) -> int: ...

def node(parent: int, kind: NodeKind, R: Sequence[float], p: Sequence[float], mass: float, com: Sequence[float], inertia: Sequence[float], coordinate: int, multiplier: float, offset: float) -> Node: ...

class JointRow:
    def __init__(self) -> None: ...

    @property
    def torque(self) -> Torque: ...

    @torque.setter
    def torque(self, arg: Torque, /) -> None: ...

    @property
    def compensated(self) -> Compensated: ...

    @compensated.setter
    def compensated(self, arg: Compensated, /) -> None: ...

    @property
    def sign(self) -> float: ...

    @sign.setter
    def sign(self, arg: float, /) -> None: ...

    @property
    def gain(self) -> float: ...

    @gain.setter
    def gain(self, arg: float, /) -> None: ...

    @property
    def bias(self) -> float: ...

    @bias.setter
    def bias(self, arg: float, /) -> None: ...

    @property
    def range(self) -> float: ...

    @range.setter
    def range(self, arg: float, /) -> None: ...

    @property
    def rotor_inertia(self) -> float: ...

    @rotor_inertia.setter
    def rotor_inertia(self, arg: float, /) -> None: ...

    @property
    def coulomb(self) -> float: ...

    @coulomb.setter
    def coulomb(self, arg: float, /) -> None: ...

    @property
    def viscous(self) -> float: ...

    @viscous.setter
    def viscous(self, arg: float, /) -> None: ...

    @property
    def coulomb_width(self) -> float: ...

    @coulomb_width.setter
    def coulomb_width(self, arg: float, /) -> None: ...

    @property
    def lower(self) -> float: ...

    @lower.setter
    def lower(self, arg: float, /) -> None: ...

    @property
    def upper(self) -> float: ...

    @upper.setter
    def upper(self, arg: float, /) -> None: ...

    @property
    def bandwidth(self) -> float: ...

    @bandwidth.setter
    def bandwidth(self, arg: float, /) -> None: ...

    @property
    def nodes(self) -> list[int]: ...

    @nodes.setter
    def nodes(self, arg: Sequence[int], /) -> None: ...

    @property
    def sources(self) -> list[int]: ...

    @sources.setter
    def sources(self, arg: Sequence[int], /) -> None: ...

class SensorRow:
    def __init__(self) -> None: ...

    @property
    def node(self) -> int: ...

    @node.setter
    def node(self, arg: int, /) -> None: ...

    @property
    def sign(self) -> float: ...

    @sign.setter
    def sign(self, arg: float, /) -> None: ...

    @property
    def turned(self) -> bool: ...

    @turned.setter
    def turned(self, arg: bool, /) -> None: ...

    @property
    def log_node(self) -> int: ...

    @log_node.setter
    def log_node(self, arg: int, /) -> None: ...

    @property
    def gravity_compensated(self) -> bool: ...

    @gravity_compensated.setter
    def gravity_compensated(self, arg: bool, /) -> None: ...

    @property
    def bandwidth(self) -> float: ...

    @bandwidth.setter
    def bandwidth(self, arg: float, /) -> None: ...

    def set_log_rotation(self, arg: Sequence[float], /) -> None: ...

    def set_axes(self, arg: Sequence[bool], /) -> None: ...

    def set_bias(self, arg: Sequence[float], /) -> None: ...

    def set_range(self, arg: Sequence[float], /) -> None: ...

class Mesh:
    def crossings(self, origin: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], direction: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]: ...

    def nearest_to_line(self, origin: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], direction: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)]) -> NDArray[numpy.float64]: ...

    def nearest_to_point(self, arg: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], /) -> NDArray[numpy.float64]: ...

def mesh(vertices: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], faces: Annotated[NDArray[numpy.int64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> Mesh: ...

class NoiseFigures:
    pass

def noise_figures(qd: Sequence[float], tau: Sequence[float], wrench: Sequence[float], period: float, wrench_error: float, torque_error: float) -> NoiseFigures: ...

class LocalizerSettings:
    def __init__(self) -> None: ...

    @property
    def friction(self) -> float: ...

    @friction.setter
    def friction(self, arg: float, /) -> None: ...

    @property
    def cone_softness(self) -> float: ...

    @cone_softness.setter
    def cone_softness(self, arg: float, /) -> None: ...

    @property
    def force_scale(self) -> float: ...

    @force_scale.setter
    def force_scale(self, arg: float, /) -> None: ...

    @property
    def place_scale(self) -> float: ...

    @place_scale.setter
    def place_scale(self, arg: float, /) -> None: ...

    @property
    def pitch_limit(self) -> float: ...

    @pitch_limit.setter
    def pitch_limit(self, arg: float, /) -> None: ...

    @property
    def least_force(self) -> float: ...

    @least_force.setter
    def least_force(self, arg: float, /) -> None: ...

    @property
    def certain(self) -> float: ...

    @certain.setter
    def certain(self, arg: float, /) -> None: ...

    @property
    def place_radius(self) -> float: ...

    @place_radius.setter
    def place_radius(self, arg: float, /) -> None: ...

    @property
    def finger(self) -> float: ...

    @finger.setter
    def finger(self, arg: float, /) -> None: ...

    @property
    def first_entry(self) -> bool: ...

    @first_entry.setter
    def first_entry(self, arg: bool, /) -> None: ...

class LinkSurface:
    def __init__(self, node: int, mesh: Mesh, graspable: bool) -> None: ...

    @property
    def node(self) -> int: ...

class Localizer:
    def __init__(self, observer: Observer, tests: Sequence[DetectionRow], noise: NoiseFigures, surfaces: Sequence[LinkSurface], settings: LocalizerSettings) -> None: ...

    def wrench_covariance(self, arg0: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], arg1: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], arg2: int, /) -> NDArray[numpy.float64]: ...

    def locate(self, segment: int, row: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], normalized: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)] | None, q: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], qd: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)] | None, quiet: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)] | None) -> NDArray[numpy.float64]: ...

    def region(self) -> NDArray[numpy.float64]: ...

    def events(self) -> NDArray[numpy.float64]: ...

    def follow(self, time: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], rows: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], normalized: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], levels: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], quiet: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], q: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)], qd: Annotated[NDArray[numpy.float64], dict(order='C', device='cpu', writable=False)]) -> tuple: ...

class Test(enum.Enum):
    rows = 0

    scaled = 1

    chi2 = 2

    glrt = 3

    cusum = 4

class DetectionRow:
    def __init__(self, segment: int, component: int, joint: int, contact: float, collision: float, baseline_limit: float, slow: Sequence[float], quick: Sequence[float]) -> None: ...

class DetectionTimes:
    def __init__(self, min_duration: float, hold: float, baseline: float, release: float) -> None: ...

class TestSetting:
    def __init__(self, test: Test, limits: Sequence[float]) -> None: ...

class DetectionSettings:
    def __init__(self, tests: Sequence[TestSetting], sum_limits: Sequence[float], times: DetectionTimes, noise: NoiseFigures, windows: Sequence[float]) -> None: ...

class Detector:
    def __init__(self, observer: Observer, rows: Sequence[DetectionRow], settings: DetectionSettings) -> None: ...

    def baseline(self, row: int) -> float: ...

def detect(arg0: Observer, arg1: Detector, arg2: float, arg3: object, arg4: object, arg5: object, arg6: object, /) -> tuple: ...

def detect_run(arg0: Observer, arg1: Detector, arg2: object, arg3: object, arg4: object, arg5: object, arg6: object, /) -> tuple: ...

def detect_details(observer: Observer, detector: Detector, time: object, q: object, qd: object, tau: object, wrench: object, every: int = 1) -> tuple: ...

class Observer:
    def __init__(self, arg0: Sequence[Node], arg1: Sequence[float], arg2: Sequence[JointRow], arg3: Sequence[SensorRow], arg4: Method, arg5: Discretization, /) -> None: ...

    def step(self, time: float, q: object, qd: object, tau: object, wrench: object) -> None: ...

    def update(self, time: float, q: object, qd: object, tau: object, wrench: object) -> numpy.typing.NDArray[numpy.float64]: ...

    def run(self, time: object, q: object, qd: object, tau: object, wrench: object) -> numpy.typing.NDArray[numpy.float64]: ...

    def terms(self, q: object, qd: object) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]: ...

    def poses(self, q: object) -> numpy.typing.NDArray[numpy.float64]: ...

    def reset(self) -> None: ...

    @property
    def slices(self, /) -> dict[str, tuple[int, int]]: ...

    @property
    def segment_sensors(self) -> list[int]: ...
