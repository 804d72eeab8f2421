"""A Franka Panda with the Franka Hand, written out as an MjSpec of capsules and boxes.

Kinematics and limits: Franka Robotics, "Robot and interface specifications" of the Franka Control Interface
(modified DH table; joint, velocity, acceleration, jerk and torque limits). Link masses: Gaz et al., "Dynamic
Identification of the Franka Emika Panda Robot", RA-L 2019, table of feasible parameters. Servo gains, armature and
damping: MuJoCo Menagerie's franka_emika_panda. Shapes are our own approximation of the links.
"""

import mujoco
import numpy as np
import numpy.typing as npt

NUM_JOINTS = 7
# Modified (Craig) DH: a_{i-1} m, alpha_{i-1} rad, d_i m
DH = (
    (0.0, 0.0, 0.333),
    (0.0, -np.pi / 2, 0.0),
    (0.0, np.pi / 2, 0.316),
    (0.0825, np.pi / 2, 0.0),
    (-0.0825, -np.pi / 2, 0.384),
    (0.0, np.pi / 2, 0.0),
    (0.088, np.pi / 2, 0.0),
)
JOINT_MIN_RAD = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
JOINT_MAX_RAD = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
MAX_VELOCITY_RAD_S = np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61])
MAX_ACCELERATION_RAD_S2 = np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0])
MAX_JERK_RAD_S3 = np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0])
MAX_TORQUE_NM = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])
LINK_MASS_KG = (4.970684, 0.646926, 3.228604, 3.587895, 1.225946, 1.666555, 0.735522)
READY_RAD = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])  # Franka's ready pose

# Flange, Hand and the point between the fingertips: Franka Hand data sheet and URDF
FLANGE_OFFSET_M = 0.107
HAND_YAW_RAD = -np.pi / 4
TCP_OFFSET_M = 0.1034
FINGER_OFFSET_M = 0.0584
FINGER_TRAVEL_M = 0.04  # each finger; 80 mm between them
HAND_MASS_KG, FINGER_MASS_KG = 0.73, 0.015
# The mimic constraint halves the actuator's force: about 20 N a finger, within the Hand's 70 N
GRIP_FORCE_N = 40.0
GRIP_STIFFNESS, GRIP_DAMPING = 3000.0, 150.0

SERVO_STIFFNESS = np.array([4500.0, 4500.0, 3500.0, 3500.0, 2000.0, 2000.0, 2000.0])
SERVO_DAMPING = SERVO_STIFFNESS / 10
JOINT_ARMATURE, JOINT_DAMPING = 0.1, 1.0

JOINT_NAMES = tuple(f"joint{i}" for i in range(1, NUM_JOINTS + 1))
FINGER_NAMES = ("finger_left", "finger_right")
PAD_NAMES = ("pad_left", "pad_right")
TCP_SITE = "tcp"
GRIPPER_CTRL = NUM_JOINTS  # index of the gripper's entry in `data.ctrl`, after the joints'
HIDDEN_GROUP = 4  # geometry groups above 2 are not drawn

# Two bodies touch if the contype of one shares a bit with the conaffinity of the other: the robot never touches itself.
ROBOT_CONTACT = {"contype": 1, "conaffinity": 2}
WHITE, LIGHT_GREY, DARK_GREY = (0.93, 0.94, 0.95, 1.0), (0.78, 0.80, 0.83, 1.0), (0.17, 0.18, 0.20, 1.0)

Point = tuple[float, float, float]
Capsule = tuple[Point, Point, float]  # from, to, radius, all m
# Each link's capsules in its DH frame
LINK_CAPSULES: tuple[tuple[Capsule, ...], ...] = (
    (((0, 0, -0.19), (0, 0, 0), 0.06), ((0, -0.06, 0), (0, 0.06, 0), 0.058)),
    (((0, 0, -0.05), (0, 0, 0.05), 0.056), ((0, -0.02, 0), (0, -0.19, 0), 0.056)),
    (
        ((0, 0, -0.10), (0, 0, -0.02), 0.055),
        ((0.0825, -0.055, 0), (0.0825, 0.055, 0), 0.052),
        ((0, 0, -0.02), (0.0825, 0, 0), 0.05),
    ),
    (((-0.02, 0.02, 0), (-0.0825, 0.12, 0), 0.052), ((0, 0, -0.05), (0, 0, 0.05), 0.052)),
    (
        ((0, 0, -0.26), (0, 0, -0.22), 0.055),
        ((0, -0.04, 0), (0, 0.04, 0), 0.05),
        ((0, 0.06, -0.2), (0, 0.06, -0.06), 0.03),
    ),
    (((0.02, 0, 0), (0.088, 0, 0), 0.042), ((0, 0, -0.04), (0, 0, 0.02), 0.048)),
    (((0, 0, -0.01), (0, 0, 0.08), 0.042),),
)


def add_panda(spec: mujoco.MjSpec, base_position_m: npt.ArrayLike) -> None:
    """Add arm, hand and actuators to `spec` (mujoco.MjSpec), the base standing at a position (3,) in the world frame.

    `ctrl` then holds seven joint targets in rad and one finger target in m (0 closed, 0.04 open).
    """
    hand = add_arm(spec, base_position_m)
    _add_hand(spec, hand)
    _add_actuators(spec)


def add_arm(spec: mujoco.MjSpec, base_position_m: npt.ArrayLike) -> mujoco.MjsBody:
    """Add the arm alone and return the body that carries the hand, with the site `tcp` between the fingertips.

    The site's z axis is the direction of approach, its y axis the one along which the fingers move.
    """
    body = spec.worldbody.add_body(name="link0", pos=base_position_m)
    _capsule(body, ((-0.04, 0, 0.06), (0, 0, 0.06), 0.06), mass_kg=2.9, rgba=WHITE)
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[0.06, 0.07, 0],
        pos=[0, 0, 0.07],
        rgba=WHITE,
        contype=0,
        conaffinity=0,
    )
    for index in range(NUM_JOINTS):
        body = _add_link(body, index)
    yawed_wxyz = [np.cos(HAND_YAW_RAD / 2), 0, 0, np.sin(HAND_YAW_RAD / 2)]
    hand = body.add_body(name="hand", pos=[0, 0, FLANGE_OFFSET_M], quat=yawed_wxyz, gravcomp=1)
    hand.add_site(name=TCP_SITE, pos=[0, 0, TCP_OFFSET_M], group=HIDDEN_GROUP)
    return hand


def _add_link(parent: mujoco.MjsBody, index: int) -> mujoco.MjsBody:
    a_m, alpha_rad, d_m = DH[index]
    position = [a_m, -np.sin(alpha_rad) * d_m, np.cos(alpha_rad) * d_m]
    turned_wxyz = [np.cos(alpha_rad / 2), np.sin(alpha_rad / 2), 0, 0]
    body = parent.add_body(name=f"link{index + 1}", pos=position, quat=turned_wxyz, gravcomp=1)
    body.add_joint(
        name=JOINT_NAMES[index],
        axis=[0, 0, 1],
        range=[JOINT_MIN_RAD[index], JOINT_MAX_RAD[index]],
        limited=1,
        armature=JOINT_ARMATURE,
        damping=[JOINT_DAMPING, 0, 0],
    )
    capsules = LINK_CAPSULES[index]
    for number, capsule in enumerate(capsules):
        _capsule(body, capsule, LINK_MASS_KG[index] / len(capsules), WHITE if number == 0 else LIGHT_GREY)
    return body


def _capsule(body: mujoco.MjsBody, capsule: Capsule, mass_kg: float, rgba: tuple[float, ...]) -> None:
    start, end, radius = capsule
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        fromto=[*start, *end],
        size=[radius, 0, 0],
        mass=mass_kg,
        rgba=rgba,
        **ROBOT_CONTACT,
    )


def _add_hand(spec: mujoco.MjSpec, hand: mujoco.MjsBody) -> None:
    box = {"type": mujoco.mjtGeom.mjGEOM_BOX, **ROBOT_CONTACT}
    hand.add_geom(size=[0.021, 0.10, 0.033], pos=[0, 0, 0.033], mass=HAND_MASS_KG, rgba=WHITE, **box)
    for side, finger_name, pad_name in zip((1, -1), FINGER_NAMES, PAD_NAMES, strict=True):
        finger = hand.add_body(name=finger_name, pos=[0, 0, FINGER_OFFSET_M], gravcomp=1)
        finger.add_joint(
            name=finger_name,
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=[0, side, 0],
            range=[0, FINGER_TRAVEL_M],
            limited=1,
            armature=0.2,
            damping=[10, 0, 0],
        )
        half_mass_kg = FINGER_MASS_KG / 2
        finger.add_geom(
            size=[0.010, 0.006, 0.011], pos=[0, side * 0.0105, 0.011], mass=half_mass_kg, rgba=DARK_GREY, **box
        )
        pad = finger.add_geom(
            name=pad_name, size=[0.010, 0.005, 0.016], pos=[0, side * 0.005, 0.037], rgba=DARK_GREY, **box
        )
        pad.mass = half_mass_kg
        # Rubber: grips by friction alone, with torsion (condim 4), and decides the friction of its contacts (priority)
        pad.friction, pad.condim, pad.priority = [1.5, 0.02, 0.001], 4, 1
        pad.solref, pad.solimp = [0.006, 1], [0.95, 0.99, 0.001, 0.5, 2]
    _couple_fingers(spec)


def _couple_fingers(spec: mujoco.MjSpec) -> None:
    mimic = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=FINGER_NAMES[1], name2=FINGER_NAMES[0])
    mimic.objtype = mujoco.mjtObj.mjOBJ_JOINT
    mimic.data[:5] = [0, 1, 0, 0, 0]  # right = 0 + 1 * left
    mimic.solref, mimic.solimp = [0.004, 1], [0.95, 0.99, 0.001, 0.5, 2]


def _add_actuators(spec: mujoco.MjSpec) -> None:
    for index, joint in enumerate(JOINT_NAMES):
        _add_servo(spec, joint, SERVO_STIFFNESS[index], SERVO_DAMPING[index], MAX_TORQUE_NM[index])
    _add_servo(spec, FINGER_NAMES[0], GRIP_STIFFNESS, GRIP_DAMPING, GRIP_FORCE_N)


def _add_servo(spec: mujoco.MjSpec, joint: str, stiffness: float, damping: float, limit: float) -> None:
    servo = spec.add_actuator(target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    servo.set_to_position(kp=stiffness, kv=damping)
    servo.forcerange, servo.forcelimited = [-limit, limit], 1
