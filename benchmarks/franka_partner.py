# SPDX-License-Identifier: Apache-2.0
# pyright: reportMissingImports=false
"""A simulated Franka arm on the loopback that moves and is pushed, for live_franka.py.

python franka_partner.py FOLDER SEED PUSHES, with the interpreter of an environment of its own that
has franky-sim 1.0.4. It writes FOLDER/robot.yaml and FOLDER/fr3.xml, serves states with an absolute
deadline of 1 ms, and ends with its standard input. Then it prints as JSON, in ticks of the arm's
clock: those it left out, pushes (begin, end, link, force), and how many came late.
"""

import json
import random
import sys
import threading
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
from franky_sim import DEFAULT_INITIAL_JOINT_POS, SimulationServer
from franky_sim.mujoco_simulator import MujocoSimulator

HOST = "127.0.0.5"
TICK = 1e-3  # s
LEFT_OUT = 1.0 / 1500.0  # share of the ticks that are not sent
STANDS, EASES = 4.0, 3.0  # s
SWING = 0.25  # rad
FORCE, HOLD, EVERY, RAMP = 20.0, 0.8, 3.0, 0.05  # N, s, s, s
LEVER = 5.0  # Nm that a push brings to a joint at least, a lever of 25 cm
# Nm/rad, Nm s/rad. With its own, 200 Nm s/rad at 1 kHz, the partner's light joints chatter.
STIFFNESS, DAMPING = (1000.0,) * 4 + (200.0,) * 3, (60.0,) * 4 + (10.0,) * 3
PREFIX = "robot0_fr3_"
ROBOT = """name: fr3
model: fr3.xml
locked: {{robot0_finger_joint2: 0.02}}
joints:
{joints}
noise: {{qd: 1.0e-4, tau: 0.02}}
"""
JOINT = (
    "  - {{name: {name}, torque: motor, rotor_inertia: {rotor}, "
    "friction: {{coulomb: {coulomb}, viscous: {viscous}, coulomb_width: 0.01}}}}"
)


class Arm:
    """The simulated arm: how it moves and what pushes it."""

    def __init__(self, simulator: MujocoSimulator, robot, seed: int, pushed: bool) -> None:
        self._sim, self._robot = simulator, robot
        self._random = random.Random(seed)
        self._rates = np.array([self._random.uniform(0.6, 1.4) for _ in range(7)])  # rad/s
        self._pushed = pushed
        self._begun: tuple[int, int, np.ndarray] | None = None  # tick, body, force
        self.pushes: list[dict] = []
        self.ticks = 0  # since somebody listens
        self.number = 0  # of the clock, as sent
        self.heard = False

    def goal(self, at: float) -> np.ndarray:
        """Where the joints shall be at a time [s]."""
        x = min(max((at - STANDS) / EASES, 0.0), 1.0)
        ease = x**3 * (10 - 15 * x + 6 * x**2)
        swing = SWING * ease * np.sin(self._rates * (at - STANDS))
        return np.array(DEFAULT_INITIAL_JOINT_POS) + swing

    def before_step(self, _) -> None:
        """The controller's torques and the push, before each step."""
        at = self.ticks * TICK
        self._robot.joint_position_control(self.goal(at))
        self.ticks += self.heard
        since = at - STANDS - EASES
        phase = since % EVERY
        if self._pushed and self._begun is None and since > 0.0 and phase < TICK:
            self._begun = (self.number, *self._push())
        if self._begun is not None:
            begin, body, force = self._begun
            left = HOLD - phase
            strength = np.clip(min(phase, left) / RAMP, 0.0, 1.0)
            self._sim.data.xfrc_applied[body, :3] = strength * force
            if left <= TICK:
                self._sim.data.xfrc_applied[body] = 0.0
                name = self._sim.model.body(body).name
                self.pushes.append(
                    {"begin": begin, "end": self.number, "link": name, "force": force.tolist()}
                )
                self._begun = None

    def _push(self) -> tuple[int, np.ndarray]:
        model, data = self._sim.model, self._sim.data
        while True:
            body = model.body(f"{PREFIX}link{self._random.randint(3, 7)}").id
            direction = np.array([self._random.gauss(0.0, 1.0) for _ in range(3)])
            force = FORCE * direction / np.linalg.norm(direction)
            J = np.zeros((3, model.nv))
            mujoco.mj_jacBodyCom(model, data, J, None, body)
            if np.abs(J.T @ force).max() > LEVER:
                return body, force


def write_robot(folder: Path, simulator: MujocoSimulator) -> None:
    """The arm's description: friction and rotors are those of the simulated arm."""
    model = simulator.model
    for ground in simulator.worldbody.findall("geom"):
        simulator.worldbody.remove(ground)
    (folder / "fr3.xml").write_text(ET.tostring(simulator.scene, encoding="unicode"))
    lines = []
    for i in range(1, 8):
        at = model.joint(f"{PREFIX}joint{i}").dofadr[0]
        lines.append(
            JOINT.format(
                name=f"{PREFIX}joint{i}",
                rotor=model.dof_armature[at],
                coulomb=model.dof_frictionloss[at],
                viscous=model.dof_damping[at],
            )
        )
    (folder / "robot.yaml").write_text(ROBOT.format(joints="\n".join(lines)))


def main() -> None:
    """Serves until standard input ends."""
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    with MujocoSimulator() as simulator:
        robot = simulator.add_robot(kp=STIFFNESS, kv=DAMPING)
        with SimulationServer(simulator, [HOST]) as server:
            write_robot(Path(sys.argv[1]), simulator)
            arm = Arm(simulator, robot, int(sys.argv[2]), sys.argv[3] == "1")
            simulator.register_pre_step_callback(arm.before_step)
            print("ready", flush=True)
            print(json.dumps(serve(server, simulator, arm, ended)), flush=True)


def serve(server, simulator, arm: Arm, ended: threading.Event) -> dict:
    """Ticks with an absolute deadline; returns what happened."""
    (link,) = server.robot_servers
    number = "_FrankaServer__message_id"
    left_out, late, chance = [], 0, random.Random(3)
    begin, ticks = time.monotonic(), 0
    while not ended.is_set():
        due = begin + ticks * TICK
        while (wait := due - time.monotonic()) > 0.0:
            time.sleep(wait)
        late += wait < -TICK
        link.process_commands()
        arm.number, arm.heard = getattr(link, number), link.udp_connected
        simulator.step()
        if link.udp_connected and chance.random() < LEFT_OUT:
            left_out.append(arm.number)
            setattr(link, number, arm.number + 1)
        else:
            link.send_state()
        ticks += 1
    return {"ticks": ticks, "late": late, "left_out": left_out, "pushes": arm.pushes}


main()
