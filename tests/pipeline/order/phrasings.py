"""What people may say to four tasks, and the objects that they mean, in order; nothing before the bar: refused."""

import numpy as np

from app.pipeline.order.space import Layout
from app.pipeline.order.taught import Taught
from app.services.predict.instruction import is_english

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
    task: Taught(tuple(places), ALIASES.get(task, {}), TAUGHT_INSTRUCTIONS[task], is_english)
    for task, places in PLACES_M.items()
}
LAYOUTS = {
    task: Layout({name: np.array(place, float) for name, place in places.items()}, np.zeros(3))
    for task, places in PLACES_M.items()
}

BUTTONS = """
red | push the red button
blue | push the azure button
yellow | push the yelow button
| drücke den blauen Knopf
blue | do not push the red button, push the blue one
| push the purple button
| open the drawer
| dance
red | press the crimson button
green | Could you please tap the green button?
blue | hit the blue one
yellow | push the yellow one, please
blue | push the blue button instead of the red one
blue | push the blue button, not the red one
blue | instead of the red button, push the blue one
red | push the button that is red
red | push the leftmost button
blue | push the rightmost button
blue | push the button farthest from the robot
green | push the button closest to the robot
green | push the third button from the left
yellow | push the second button from the left
yellow | push the button between the red and the green button
| push the button
| push it
| push all buttons
| push the blue button twice
| push the red button three times
red, blue | push the red button and the blue button
red, blue | push the red button, then the blue button
red, blue | push the red button and then press the blue one
blue, red | first push the blue button, then the red one
| don't push the red button
| push the red cup
| push the big red button
| pull the red button
| push the red button or the blue button
| push the button which is not red
green | robot, press green
blue | push the navy blue button
| push the red button with the stick
| pousse le bouton bleu
| push the red button slowly
red | red button
| never push the green button
| push the red button on the blue button
green | I'd like you to press the green button
red | the red button needs to be pressed
yellow | push the golden button
green | push the emerald one
| push the turquoise button
| push the fifth button from the left
blue | press down on the blue button
blue | push the button behind the green one
red, green | push red, then green
green, red, blue | press the green, the red and the blue button
| press every button but the red one
| push the other button
yellow | push the second leftmost button
| hold down the red button
red | Push the button furthest to the left.
| empuja el botón rojo
yellow | push the button immediately to the right of the red one
| do not press anything
green | forget the red button, push the green one
| push the button that I pointed at
blue | push blue
| push the red button's neighbour
red | hit the reddish button
| push the blue button and don't push it
| press not
| push not the red button
| push the red button, don't push
| push the red button, please don't
| push the red button, instead push the blue one
| push the red button, or rather the blue one
| push the red button, the blue button
| push the red button. The blue button.
| don't push the red button and push the blue one
| do not push the red button, the blue one
| do not push the red button and the blue button
| don't stop until you push the red button
| push the red button to the left
| push the blue-green button
| push the light button
| push the button that isn't red
| push the non-red button
| push the red button up
| push and hold the red button
| push the left button
| push the button in the middle
| push the second button
| push the last button
| push the button next to the yellow button
| push my button
| push the button on my left
red | the red button
| push a button
| push any button
| push two buttons
| push the blue buttons
| push the red button next to the blue button
| push the red button on the right
| push the red button but first the blue one
| push the red button before you push the blue one
| push the lemon
| push the cherry
| if the red button is lit, push the blue one
| push the red button unless it is stuck
| could you not push the red button
| i do not want you to push the red button
| push the red light
red | push the red
| slide the red button
| touch the red button
| grasp the red button
| push the red button hard
| push everything that is red
| push the rad button
| push the button nearest to me
| duw op de rode knop
| premi il pulsante rosso
| appuie sur le bouton rouge
| tryck på den röda knappen
| нажми красную кнопку
| 按红色按钮
| 赤いボタンを押して
| push the red button 2 times
| push button 3
| push the button red or blue
| pushing is fun
| what is the red button
red, blue | red and blue
| push the redblue button
| undo pushing the red button
| push the red button again
| push the same button
| ignore the red button
| rather push the red button than the blue one
| push the red button instead
green | kindly tap the lime button
blue | could you hit the navy one for me?
red | I want you to push the scarlet button
yellow | push the button second from the left
| push the brown button
| push the shiny red button
red | the leftmost button, please push it
blue | push the button that is farthest away from you
green, blue | press the green button and then the blue one
| push the red button and pull the blue one
| drück auf den roten Knopf
| please release the red button
blue | not the red button, the blue button
| push the white button
yellow | psuh the yellwo button
| push the red and green button
blue | push the cobalt blue button
| whichever button you like
| turn on the red button
blue | push the button to the right of the green one
"""

CUBES = """
red, blue | stack the red cube on the blue cube
blue, red | stack the blue cube on the red cube
red, blue | put the red cube on top of the blue one
blue, red | place the blue block onto the red block
red, blue | on the blue cube, stack the red one
red, blue | pick up the red cube and place it on the blue one
| stack the red cube
| stack the cubes
| stack the green cube on the blue cube
| put the red cube next to the blue cube
red, blue | stack the crimson cube on the navy cube
| unstack the red cube from the blue cube
red, blue | stack the left cube on the right cube
red, blue | satck the red cube on the bleu cube
| throw the red cube at the blue cube
| stack the red cube under the blue cube
| stack the red cube on itself
| staple den roten Würfel auf den blauen
blue, red | could you put the blue cube atop the red cube?
blue, red | set the blue cube down on the red cube
| swap the two cubes
blue, red | stack the blue one onto the red one
red, blue | take the red cube and stack it on the blue cube
| stack the red cube on the table
blue, red | move the blue block on top of the red block
| put the blue cube inside the red cube
red, blue | don't stack blue on red but red on blue
| stack the blue cube
| stack the red cube on the blue cube twice
| stack the red cube on the red cube
| stack red
| unstack the red cube
| stack the red cube on the blue ball
| put the red cube in front of the blue cube
| put the red cube behind the blue cube
| put the red cube on the left
| stack the cube on the cube
| stack the other cube on the blue cube
| stack both cubes
| stack the red cube and the blue cube
| don't stack the red cube on the blue cube
| stack the red cube not on the blue cube
| stack the cubes with red on top
| do the opposite of stacking the red cube on the blue cube
| stack red blue
| put the red cube over the blue cube
| pick up the red cube
| drop the red cube on the blue cube
| push the red cube onto the blue cube
blue, red | stack blue on red
blue, red | grab the blue cube and put it on top of the red cube
red, blue | place the ruby cube upon the blue cube
| stack three cubes
| balance the red cube on the blue cube
blue, red | put the sapphire block on the red block
| lift the red cube
| stack the red cube on the yellow cube
red, blue | the red cube should be placed on the blue cube
| don't put the red cube on the blue cube
| stack the red cube near the blue cube
"""

DRAWERS = """
top | open the top drawer
bottom | open drawer_bottom
middle | open the middle one
top | open the upper drawer
bottom | open the lowest drawer
top | pull open the top drawer
| close the top drawer
| open the drawer
| open the left drawer
bottom, top | open the bottom drawer, then the top one
top | open the highest drawer
bottom | open teh botom drawer
| open the door
top | open the top drawer, not the bottom one
| öffne die oberste Schublade
| open every drawer
middle | open the drawer between the top and the bottom drawer
bottom | open the drawer below the middle one
| slam the top drawer
| open the top drawer halfway
middle | open the second drawer from below
bottom | open the bottom-most drawer
top | could you open up the top drawer for me, please?
| open the drawer with the knives
| opne teh cupboard
middle | open the drawer in the middle
top | slide open the uppermost drawer
| open the top drawer a little
| open the fourth drawer
| open the top cupboard
| open the second drawer
| shut drawer_top
| open the drawers
top, bottom | open the top and bottom
| open the leftmost drawer
| open the upper door
| pull the top drawer
| open the top of the drawer
| open the drawer above the top drawer
| unopen the top drawer
| open the stop drawer
| open
| reopen the top drawer
| open the top drawer and close it
| open the other drawer
bottom | please open the lower-most drawer
top | open the first drawer from the top
| lock the top drawer
| open the drawer on the right
middle | could you open the central drawer?
top, bottom | open the top drawer and the bottom drawer
| open the box
| apri il cassetto in alto
top | open the drawer above the middle one
"""

THINGS = """
mug | pick up the mug
mug | grab the coffee cup
bowl | lift the bowl
mug | take the mgu
mug, plate | put the mug on the plate
bowl, plate | place the bowl on the plate
mug, plate | pick up the mug and put it on the plate
| pick up the fork
| pick up the blue mug
mug | pick up the thing closest to the robot
mug | pick up the leftmost object
| put the mug in the bowl
| wash the plate
| pick up everything
bowl | do not take the mug, take the bowl
bowl | pick up the bowl rather than the mug
| pick up the mugs and bowls
| bring me the mug
| pick up the rug
| put down the mug
| nimm die Tasse
bowl | pick the bowl up
bowl, plate | on the plate, place the bowl
| pick up something
mug | get the cup
bowl | pick up the bowl, not the plate
| pick up the plate and the mug's handle
mug, plate | set the mug down on the plate
bowl | lift up the object between the mug and the plate
| pick up the saucer
plate | take the plate
| hand me the bowl
| put the mug under the plate
mug | pick the coffee cup up
| put the mug on the left
| put the bowl on the table
| put the mug on the plate and the bowl
| pick up the mug with the bowl
| put the mug back
| pick up the plates
| pick up the spoon
| pick up the mug on the plate
| pick up the cap
| pick up the plane
| pick up the big plate
| put the mug next to the plate
| put the mug off the plate
| pick up the coffee
| pour the coffee cup
| take the mug off the plate
| pick up anything but the mug
| put it on the plate
| pick up that
| pick up the bowling
| turn the mug
| stack the mug and the bowl
| place the mug under the bowl
| pick up the mug's handle
| lift the mug 10 cm
| lift the mug and shake it
| pick up the dinner plate
| put the plate under the mug
bowl | grasp the bowl
mug | pick up the coffee cup, please
plate | lift the plate
| eat from the bowl
| pick up the glass
bowl, plate | set the bowl onto the plate
| put the bowl beside the plate
| pick up two bowls
plate | pick up the object farthest from the robot
mug | do not pick up the bowl but the mug
| move the mug
| ramasse la tasse
mug | pikc up the mug
"""

# Clear to people, and refused all the same.
REFUSED_THOUGH_CLEAR = """
buttons: green | pres the gren buton
cubes: blue, red | please stack the left... no, the blue cube on the red cube
buttons: blue | give the blue button a push
buttons: blue, red | push the red button after the blue one
cubes: red, blue | the red cube goes on the blue cube
"""


def listed(text):
    """(expected words, instruction) of every line."""
    pairs = [line.split("|", 1) for line in text.strip().splitlines()]
    return [([word.strip() for word in words.split(",") if word.strip()], said.strip()) for words, said in pairs]


PHRASINGS = [
    (task, words, said)
    for task, text in (("buttons", BUTTONS), ("cubes", CUBES), ("drawers", DRAWERS), ("things", THINGS))
    for words, said in listed(text)
]


def meant(task, words):
    """The objects that the words tell apart."""
    return tuple(next(name for name in PLACES_M[task] if word in name) for word in words)
