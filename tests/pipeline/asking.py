"""Short ways to ask a codec, and to read what it is answered."""

from app.pipeline.episode import Query
from app.pipeline.reply import ReplyReader
from app.pipeline.representation import fit_codec
from app.pipeline.skill.choice import choose
from app.pipeline.skill.recording import at_keyframes
from app.pipeline.skill.scene import Scene
from app.pipeline.skill.shown import Shown
from tests.pipeline.scenes import WORKSPACE


def grammar_of(codec, instruction):
    """Of replies to a query about the objects of the codec's demonstrations."""
    return codec.grammar(Query(instruction, codec.demonstrations[0].objects), 25)


def schema_of(codec, instruction):
    """The same as a JSON Schema."""
    return codec.schema(Query(instruction, codec.demonstrations[0].objects), 25)


def parse_reply(reply_text, codec, objects, instruction, max_actions=25):
    """The actions of a whole reply."""
    return ReplyReader(codec, Query(instruction, tuple(objects)), max_actions).finish(reply_text)


def codec_of(representation, prompt_format, demonstrations, workspace=WORKSPACE):
    """The codec of demonstrations as they are."""
    return fit_codec(representation, prompt_format, shown_as_they_are(demonstrations), workspace)


def shown_as_they_are(demonstrations):
    """Demonstrations without their motion, each with the rows that those of its kind share."""
    rows, kinds = {}, [(item.order.form, tuple(a.gripper_open for a in item.actions)) for item in demonstrations]
    for kind in dict.fromkeys(kinds):
        places = [place for place, own in enumerate(kinds) if own == kind]
        alike = [demonstrations[place] for place in places]
        fitted = choose(at_keyframes(alike, [Scene.of(item) for item in alike])) if alike[0].actions else ()
        rows.update(dict.fromkeys(places, fitted))
    return [Shown(item, rows[place]) for place, item in enumerate(demonstrations)]
