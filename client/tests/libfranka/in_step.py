"""franky-sim's server in step with the arm's program: a busy machine slows a motion down and does not change it."""

from select import select

import franky_sim

ANSWER_S = 0.5  # for the program's next command; libfranka itself gives up after 1 s without a state
FIRST_ANSWER_S = 0.02  # libfranka reads some states of a motion before its first command


class InStepServer(franky_sim.SimulationServer):
    """Simulates the next millisecond of a motion once the program has answered the last state.

    A real control unit does not wait: it stops the arm with `communication_constraints_violation`. franky-sim alone
    repeats the last command, so that the arm jerks and lags.
    """

    def init(self) -> None:
        super().init()
        self._motions = dict.fromkeys(self.robot_servers, (0, False))  # id, and whether it had a command

    def run_once(self, realtime: bool | float = True) -> None:
        """Simulate 1 ms."""
        for robot, (before, answered) in self._motions.items():
            motion = robot.current_motion_id
            answered = answered and motion == before
            if motion:
                commands, requests = robot._FrankaServer__udp_socket, robot._tcp_socket
                ready, _, _ = select([commands, requests], [], [], ANSWER_S if answered else FIRST_ANSWER_S)
                answered = answered or commands in ready
            self._motions[robot] = motion, answered
        super().run_once(realtime)
