"""Programs for the baseline after VoxPoser, written by people: with them its planner is measured without a model.

Each knows how its task is done, as the task's expert does, and sees no more than a model's program would: the objects
in the first image, by voxels. `mentioned` stands before each, the objects in the order of the instruction.
"""

import json
import re
from collections.abc import Mapping, Sequence

_COMMON = """
def near(yaw, symmetry):
    return (yaw + symmetry / 2) % symmetry - symmetry / 2

def go(place, turn, fingers_after):
    target = empty_affordance_map()
    set_voxels(target, place)
    rotation = empty_rotation_map()
    rotation[:, :, :] = turn
    fingers = empty_gripper_map()
    set_voxels(fingers, place, fingers_after)
    move(target, rotation=rotation, gripper=fingers)

def pick(place, turn, height):
    go(shifted(place, 0, 0, height), turn, 1)
    go(place, turn, 0)
    go(shifted(place, 0, 0, height), turn, 0)

def put(place, turn, height):
    go(shifted(place, 0, 0, height), turn, 0)
    go(place, turn, 1)
    go(shifted(place, 0, 0, height), turn, 1)

def slide(thing, first_cm, last_cm, y_cm, z_cm, turn, fingers):
    steps = int(abs(last_cm - first_cm) / 3) + 1
    for step in range(steps):
        x_cm = first_cm + (last_cm - first_cm) * (step + 1) / steps
        go(shifted_along(thing, x_cm, y_cm, z_cm), turn, fingers)

def closed_fingers():
    go(hand(), pointing_down(), 0)
"""
_PRESS = """
closed_fingers()
for name in mentioned:
    button = detect(name)
    for height in (8, -1, 8):
        go(shifted(button, 0, 0, height), pointing_down(), 0)
"""
_OPEN_DRAWER = """
drawer = detect("bottom drawer")
tilted = pointing_down(drawer.yaw_deg, 34.4)
go(shifted_along(drawer, -12, 0, 6), tilted, 1)
go(drawer.position, tilted, 0)
slide(drawer, 0, -17.5, 0, 0, tilted, 0)
go(shifted_along(drawer, -17.5), tilted, 1)
go(shifted_along(drawer, -20.9, 0, 5), tilted, 1)
"""
# The way into a case with shelves: hand and wrist come in tilted, and leave as they came.
_INTO_CASE = """
yaw = near(thing.yaw_deg, 180)
sign = 1 if abs(yaw - thing.yaw_deg) < 1 else -1
grasp = pointing_down(yaw, 40.1)
go(shifted_along(thing, sign * (-1 - 7.7), 0, high + 9.2), grasp, 1)
go(shifted_along(thing, -sign, 0, high), grasp, 0)
go(shifted_along(thing, -sign, 0, high + 12), grasp, 0)
release = pointing_down(case.yaw_deg, 40.1)
go(shifted_along(case, 3.5 - back, 0, inside + rise), release, 0)
go(shifted_along(case, 3.5, 0, inside), release, 1)
go(shifted_along(case, 3.5 - back, 0, inside + rise), release, 1)
"""

PROGRAMS: Mapping[str, str] = {
    "push_button": _PRESS,
    "push_button_real": _PRESS,
    "push_multiple_buttons": _PRESS,
    "stack_cube": """
upper = detect(mentioned[0])
lower = detect(mentioned[1])
pick(upper.position, pointing_down(near(upper.yaw_deg, 90)), 10)
put(shifted(lower, 0, 0, 5.4), pointing_down(near(lower.yaw_deg, 90)), 10)
""",
    "destack_cube": """
upper = detect(mentioned[0])
yaw = near(upper.yaw_deg, 90)
pick(upper.position, pointing_down(yaw), 10)
put(shifted(upper, 0, -15, -4.6), pointing_down(yaw), 10)
""",
    "open_drawer": _OPEN_DRAWER,
    "put_in_drawer": _OPEN_DRAWER
    + """
block = detect("block")
release = pointing_down(drawer.yaw_deg)
drop = shifted_along(drawer, -10, 0, 0.5)
go(shifted(drop, 0, 0, 30), release, 1)
pick(block.position, pointing_down(near(block.yaw_deg, 90)), 8)
put(drop, release, 30)
""",
    "close_jar": """
lid = detect("lid")
rim = shifted(detect("red jar"), 0, 0, 1.2)
pick(lid.position, pointing_down(), 10)
go(shifted(rim, 0, 0, 10), pointing_down(45), 0)
go(rim, pointing_down(45), 0)
go(rim, pointing_down(-45), 1)
go(shifted(rim, 0, 0, 10), pointing_down(-45), 1)
""",
    "stack_blocks": """
platform = detect("green platform")
heights = (3, 7.8)
for number, name in enumerate(("first red block", "second red block")):
    block = detect(name)
    pick(block.position, pointing_down(near(block.yaw_deg, 90)), 10)
    put(shifted(platform, 0, 0, heights[number]), pointing_down(near(platform.yaw_deg, 90)), 10)
""",
    "screw_bulb": """
bulb = detect("red light bulb")
seat = shifted(detect("lamp"), 0, 0, 2)
pick(bulb.position, pointing_down(), 10)
go(shifted(seat, 0, 0, 10), pointing_down(60), 0)
go(seat, pointing_down(60), 0)
go(seat, pointing_down(-60), 1)
go(shifted(seat, 0, 0, 10), pointing_down(-60), 1)
""",
    "meat_off_grill": """
chicken = detect("chicken")
grill = detect("grill")
pick(chicken.position, pointing_down(near(chicken.yaw_deg, 180)), 15)
put(shifted_along(grill, 0, 26, -7), pointing_down(grill.yaw_deg), 15)
""",
    "stack_cups": """
target = detect("green cup")
rises = (3.5, 5.7)
for number, name in enumerate(("red cup", "blue cup")):
    cup = detect(name)
    pick(shifted(cup, 0, -3.55, -1), pointing_down(), 14)
    put(shifted(target, 0, -3.55, rises[number] - 1), pointing_down(), 14)
""",
    "sort_shape": """
cube = detect("cube")
sorter = detect("shape sorter")
pick(shifted(cube, 0, 0, 1), pointing_down(near(cube.yaw_deg, 90)), 12)
put(shifted(sorter, 0, 0, 3.2), pointing_down(near(sorter.yaw_deg, 90)), 12)
""",
    "close_laptop": """
laptop = detect("laptop")
down = pointing_down(laptop.yaw_deg)
closed_fingers()
for x, z in ((-23.5, 25.6), (-23.5, 16.6), (-4.4, 16.6), (2.6, 9.6), (4.5, 2.4), (4.5, 11.4)):
    go(shifted_along(laptop, x, 0, z), down, 0)
""",
    "unplug_cable": """
cable = detect("cable")
turn = pointing_down(cable.yaw_deg)
go(shifted_along(cable, 1, 0, 10.4), turn, 1)
go(shifted_along(cable, 1, 0, 0.4), turn, 0)
slide(cable, 1, 10, 0, 0.4, turn, 0)
go(shifted_along(cable, 10, 0, 0.4), turn, 1)
go(shifted_along(cable, 10, 0, 10.4), turn, 1)
""",
    "slide_block": """
target = detect("green target")
turn = pointing_down(target.yaw_deg)
closed_fingers()
go(shifted_along(target, -23.5, 0, 12.2), turn, 0)
go(shifted_along(target, -23.5, 0, 2.2), turn, 0)
slide(target, -23.5, -4, 0, 2.2, turn, 0)
go(shifted_along(target, -4, 0, 12.2), turn, 0)
""",
    "turn_tap": """
bar = detect("left tap")
yaw = near(bar.yaw_deg, 180)
go(shifted(bar, 0, 0, 10), pointing_down(yaw), 1)
go(bar.position, pointing_down(yaw), 0)
go(bar.position, pointing_down(yaw + 55), 0)
go(bar.position, pointing_down(yaw + 110), 1)
go(shifted(bar, 0, 0, 10), pointing_down(yaw + 110), 1)
""",
    "put_in_safe": """
thing = detect("money")
case = detect("safe")
high = 0.5
inside = 3.3
back = 16
rise = 6
"""
    + _INTO_CASE,
    "put_in_cupboard": """
thing = detect("crackers")
case = detect("cupboard")
high = 4
inside = 10.5
back = 18
rise = 4
"""
    + _INTO_CASE,
    "sweep_to_dustpan": """
broom = detect("broom")
pan = detect("dustpan")
pick(broom.position, pointing_down(broom.yaw_deg + 90), 8)
turn = pointing_down(pan.yaw_deg + 90)
go(shifted_along(pan, -13.2, 0, 20), turn, 0)
go(shifted_along(pan, -13.2, 0, 12), turn, 0)
slide(pan, -13.2, 4.5, 0, 12, turn, 0)
go(shifted_along(pan, 4.5, 0, 20), turn, 0)
""",
    "place_wine": """
bottle = detect("wine bottle")
rack = detect("rack")
grasp = pointing_down(90, 45.8)
go(shifted(bottle, 0, -8.6, 8.4), grasp, 1)
go(bottle.position, grasp, 0)
go(shifted(bottle, 0, 0, 12), grasp, 0)
release = pointing_down(rack.yaw_deg, -44.2)
lying = shifted_along(rack, 11, 0, 3.3)
put(lying, release, 12)
""",
    "place_cups": """
cup = detect("red cup")
holder = detect("cup holder")
yaw = near(holder.yaw_deg, 120)
sector = round((yaw - holder.yaw_deg) / 120) % 3
cosines = (1, -0.5, -0.5)
sines = (0, 0.866, -0.866)
cosine = cosines[sector]
sine = sines[sector]
pick(cup.position, pointing_down(cup.yaw_deg), 22)
hang = pointing_down(yaw + 90)
for out, height, fingers in ((12.5, 13.1, 0), (12.5, 3.1, 0), (9, 3.1, 0), (6, 3.1, 1), (6, 13.1, 1)):
    x = -out * cosine + 5.55 * sine
    y = -out * sine - 5.55 * cosine
    go(shifted_along(holder, x, y, height), hang, fingers)
""",
}


def oracle_program(task: str, instruction: str, object_names: Sequence[str]) -> str:
    """The program that solves a scene of the task.

    Raises:
        KeyError: for a task without one.
    """
    pattern = "|".join(re.escape(name) for name in sorted(object_names, key=len, reverse=True))
    mentioned = ", ".join(map(json.dumps, re.findall(pattern, instruction)))
    return f"mentioned = [{mentioned}]\n{_COMMON}{PROGRAMS[task]}"
