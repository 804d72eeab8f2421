"""What people may say to four tasks, with the objects that they mean, in order; nothing before the bar: refused."""

import numpy as np

from app.pipeline.order.space import Layout
from app.pipeline.order.taught import TaughtWords

# In the robot's frame: x forward, y left, z up.
PLACES_M = {
    "buttons": {
        "red button": (0.30, 0.30, 0.80), "yellow button": (0.35, 0.10, 0.80),
        "green button": (0.32, -0.10, 0.80), "blue button": (0.45, -0.30, 0.80),
    },
    "cubes": {"red cube": (0.3, 0.15, 0.78), "blue cube": (0.4, -0.1, 0.78)},
    "drawers": {"drawer_top": (0.5, 0, 1.2), "drawer_middle": (0.5, 0, 1.0), "drawer_bottom": (0.5, 0, 0.8)},
    "things": {"mug": (0.3, 0.2, 0.8), "bowl": (0.4, 0, 0.8), "plate": (0.5, -0.25, 0.8)},
}  # fmt: skip
TAUGHT_INSTRUCTIONS = {
    "buttons": [f"push the {name}" for name in PLACES_M["buttons"]],
    "cubes": ["stack the red cube on the blue cube", "stack the blue cube on the red cube"],
    "drawers": ["open the top drawer", "open the middle drawer", "open the bottom drawer"],
    "things": ["pick up the mug", "pick up the bowl", "put the mug on the plate", "put the bowl on the plate"],
}
ALIASES = {"things": {"mug": ("coffee cup",)}}
TAUGHT = {
    task: TaughtWords(tuple(places), ALIASES.get(task, {}), TAUGHT_INSTRUCTIONS[task])
    for task, places in PLACES_M.items()
}
LAYOUTS = {
    task: Layout({name: np.array(place, float) for name, place in places.items()}, np.zeros(3))
    for task, places in PLACES_M.items()
}

BUTTONS = """
red | push the red button / press the crimson button / push the button that is red / push the leftmost button
red | red button / the red button needs to be pressed / Push the button furthest to the left. / hit the reddish button
red | the red button / push the red / I want you to push the scarlet button / the leftmost button, please push it
blue | push the azure button / do not push the red button, push the blue one / hit the blue one
blue | push the blue button instead of the red one / push the blue button, not the red one
blue | instead of the red button, push the blue one / push the rightmost button
blue | push the button farthest from the robot / push the navy blue button / press down on the blue button
blue | push the button behind the green one / push blue / could you hit the navy one for me
blue | push the button that is farthest away from you / not the red button, the blue button
blue | push the cobalt blue button / push the button to the right of the green one
yellow | push the yellow one, please / push the second button from the left
yellow | push the button between the red and the green button / push the golden button
yellow | push the second leftmost button / push the button immediately to the right of the red one
yellow | push the button second from the left
green | Could you please tap the green button / push the button closest to the robot
green | push the third button from the left / robot, press green / I'd like you to press the green button
green | push the emerald one / forget the red button, push the green one / kindly tap the lime button
red, blue | push the red button and the blue button / push the red button, then the blue button
red, blue | push the red button and then press the blue one / red and blue
blue, red | first push the blue button, then the red one
red, green | push red, then green
green, red, blue | press the green, the red and the blue button
green, blue | press the green button and then the blue one
| drücke den blauen Knopf / push the purple button / open the drawer / dance / push the button / push it
| push all buttons / push the blue button twice / push the red button three times / don't push the red button
| push the red cup / push the big red button / pull the red button / push the red button or the blue button
| push the button which is not red / push the red button with the stick / pousse le bouton bleu
| push the red button slowly / never push the green button / push the red button on the blue button
| push the turquoise button / push the fifth button from the left / press every button but the red one
| push the other button / hold down the red button / empuja el botón rojo / do not press anything
| push the button that I pointed at / push the red button's neighbor / push the blue button and don't push it
| press not / push not the red button / push the red button, don't push / push the red button, please don't
| push the red button, instead push the blue one / push the red button, or rather the blue one
| push the red button, the blue button / push the red button. The blue button.
| don't push the red button and push the blue one / do not push the red button, the blue one
| do not push the red button and the blue button / don't stop until you push the red button
| push the red button to the left / push the blue-green button / push the light button
| push the button that isn't red / push the non-red button / push the red button up / push and hold the red button
| push the left button / push the button in the middle / push the second button / push the last button
| push the button next to the yellow button / push my button / push the button on my left / push a button
| push any button / push two buttons / push the blue buttons / push the red button next to the blue button
| push the red button on the right / push the red button but first the blue one
| push the red button before you push the blue one / push the lemon / push the cherry
| if the red button is lit, push the blue one / push the red button unless it is stuck
| could you not push the red button / i do not want you to push the red button / push the red light
| slide the red button / touch the red button / grasp the red button / push the red button hard
| push everything that is red / push the rad button / push the button nearest to me / duw op de rode knop
| premi il pulsante rosso / appuie sur le bouton rouge / tryck på den röda knappen / нажми красную кнопку / 按红色按钮
| 赤いボタンを押して / push the red button 2 times / push button 3 / push the button red or blue / pushing is fun
| what is the red button / push the redblue button / undo pushing the red button / push the red button again
| push the same button / ignore the red button / rather push the red button than the blue one
| could you push the red button?
| push the red button instead / push the brown button / push the shiny red button
| push the red button and pull the blue one / drück auf den roten Knopf / please release the red button
| push the red button left / push the yellow button far left / push the red button and the blue buttons
| push the button closest to the red and green buttons / push the button next to the red button and the green button
| push the white button / push the red and green button / whichever button you like / turn on the red button
"""

CUBES = """
red, blue | stack the red cube on the blue cube / put the red cube on top of the blue one
red, blue | on the blue cube, stack the red one / pick up the red cube and place it on the blue one
red, blue | stack the crimson cube on the navy cube / stack the left cube on the right cube
red, blue | take the red cube and stack it on the blue cube
red, blue | don't stack blue on red but red on blue / place the ruby cube upon the blue cube
red, blue | the red cube should be placed on the blue cube
blue, red | stack the blue cube on the red cube / place the blue block onto the red block
blue, red | could you put the blue cube atop the red cube / set the blue cube down on the red cube
blue, red | stack the blue one onto the red one / move the blue block on top of the red block / stack blue on red
blue, red | grab the blue cube and put it on top of the red cube / put the sapphire block on the red block
| stack the red cube / stack the cubes / stack the green cube on the blue cube
| put the red cube next to the blue cube / unstack the red cube from the blue cube
| throw the red cube at the blue cube / stack the red cube under the blue cube / stack the red cube on itself
| staple den roten Würfel auf den blauen / swap the two cubes / stack the red cube on the table
| put the blue cube inside the red cube / stack the blue cube / stack the red cube on the blue cube twice
| stack the red cube on the red cube / stack red / unstack the red cube / stack the red cube on the blue ball
| put the red cube in front of the blue cube / put the red cube behind the blue cube / put the red cube on the left
| stack the cube on the cube / stack the other cube on the blue cube / stack both cubes
| stack the red cube and the blue cube / don't stack the red cube on the blue cube
| stack the red cube not on the blue cube / stack the cubes with red on top
| do the opposite of stacking the red cube on the blue cube / stack red blue / put the red cube over the blue cube
| pick up the red cube / drop the red cube on the blue cube / push the red cube onto the blue cube / stack three cubes
| balance the red cube on the blue cube / lift the red cube / stack the red cube on the yellow cube
| don't put the red cube on the blue cube / stack the red cube near the blue cube
"""

DRAWERS = """
top | open the top drawer / open the upper drawer / pull open the top drawer / open the highest drawer
top | open the top drawer, not the bottom one / could you open up the top drawer for me, please
top | slide open the uppermost drawer / open the first drawer from the top / open the drawer above the middle one
bottom | open drawer_bottom / open the lowest drawer / open the drawer below the middle one
bottom | open the bottom-most drawer / please open the lower-most drawer
middle | open the middle one / open the drawer between the top and the bottom drawer
middle | open the second drawer from below / open the drawer in the middle / could you open the central drawer
bottom, top | open the bottom drawer, then the top one
top, bottom | open the top and bottom / open the top drawer and the bottom drawer
| close the top drawer / open the drawer / open the left drawer / open the door / öffne die oberste Schublade
| open every drawer / slam the top drawer / open the top drawer halfway / open the drawer with the knives
| opne teh cupboard / open the top drawer a little / open the fourth drawer / open the top cupboard
| open the second drawer / shut drawer_top / open the drawers / open the leftmost drawer / open the upper door
| pull the top drawer / open the top of the drawer / open the drawer above the top drawer / unopen the top drawer
| open the stop drawer / open / reopen the top drawer / open the top drawer and close it / open the other drawer
| lock the top drawer / open the drawer on the right / open the box / apri il cassetto in alto
"""

THINGS = """
mug | pick up the mug / grab the coffee cup / pick up the thing closest to the robot
mug | pick up the leftmost object / get the cup / pick the coffee cup up / pick up the coffee cup, please
mug | do not pick up the bowl but the mug
bowl | lift the bowl / do not take the mug, take the bowl / pick up the bowl rather than the mug / pick the bowl up
bowl | pick up the bowl, not the plate / lift up the object between the mug and the plate / grasp the bowl
mug, plate | put the mug on the plate / pick up the mug and put it on the plate / set the mug down on the plate
bowl, plate | place the bowl on the plate / on the plate, place the bowl / set the bowl onto the plate
plate | take the plate / lift the plate / pick up the object farthest from the robot
| pick up the fork / pick up the blue mug / put the mug in the bowl / wash the plate / pick up everything
| pick up the mugs and bowls / bring me the mug / pick up the rug / put down the mug / nimm die Tasse
| pick up something / pick up the plate and the mug's handle / pick up the saucer / hand me the bowl
| put the mug under the plate / put the mug on the left / put the bowl on the table
| put the mug on the plate and the bowl / pick up the mug with the bowl / put the mug back / pick up the plates
| pick up the spoon / pick up the mug on the plate / pick up the cap / pick up the plane / pick up the big plate
| put the mug next to the plate / put the mug off the plate / pick up the coffee / pour the coffee cup
| take the mug off the plate / pick up anything but the mug / put it on the plate / pick up that / pick up the bowling
| turn the mug / stack the mug and the bowl / place the mug under the bowl / pick up the mug's handle
| lift the mug 10 cm / lift the mug and shake it / pick up the dinner plate / put the plate under the mug
| eat from the bowl / pick up the glass / put the bowl beside the plate / pick up two bowls / move the mug
| ramasse la tasse / take the mgu / pikc up the mug
"""

# Clear to people, and refused all the same.
REFUSED_THOUGH_CLEAR = """
cubes: blue, red | please stack the left... no, the blue cube on the red cube
buttons: blue | give the blue button a push
buttons: blue, red | push the red button after the blue one
cubes: red, blue | the red cube goes on the blue cube
"""


def listed(text):
    """(expected words, instruction) of every instruction."""
    pairs = [line.split("|", 1) for line in text.strip().splitlines()]
    return [
        ([word.strip() for word in words.split(",") if word.strip()], each.strip())
        for words, said in pairs
        for each in said.split("/")
    ]


PHRASINGS = [
    (task, words, said)
    for task, text in (("buttons", BUTTONS), ("cubes", CUBES), ("drawers", DRAWERS), ("things", THINGS))
    for words, said in listed(text)
]


def meant(task, words):
    """The objects that the words tell apart."""
    return tuple(next(name for name in PLACES_M[task] if word in name) for word in words)
