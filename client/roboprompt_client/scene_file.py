"""What a robot sees, as a file."""

import json
from pathlib import Path

from roboprompt_client.errors import InvalidInputError
from roboprompt_client.robot import Observation
from roboprompt_client.trajectory import ObjectPose

OBJECTS = 'JSON: [{"name": "cube", "position": [x, y, z]}], metres, each with "quaternion_xyzw" where it is known'


def observation_from_file(field: str, path: Path) -> Observation:
    """The objects of a JSON file.

    Args:
        field: what an error names.

    Raises:
        InvalidInputError: if it cannot be read, or is no list of objects.
    """
    try:
        items = json.loads(path.read_text())
        return Observation(tuple(ObjectPose(i["name"], i["position"], i.get("quaternion_xyzw")) for i in items))
    except InvalidInputError as error:
        raise InvalidInputError(f"{field}: {path}: {error.field}", error.message, OBJECTS) from error
    except (OSError, ValueError) as error:
        raise InvalidInputError(field, f"{path} cannot be read: {error}", f"a file with {OBJECTS}") from error
    except (KeyError, TypeError, AttributeError) as error:
        raise InvalidInputError(field, f"{path} is no list of objects", OBJECTS) from error
