"""Pickles that no RLBench has written, instruction by instruction."""

import pickletools
import struct


def text(value):
    data = value.encode()
    return b"X" + struct.pack("<I", len(data)) + data


def octets(value):
    return b"B" + struct.pack("<I", len(value)) + value


def number(value):
    return b"J" + struct.pack("<i", value)


def name(module, attribute):
    return f"c{module}\n{attribute}\n".encode()


def tuple_of(*items):
    return b"(" + b"".join(items) + b"t"


def call(function, *arguments):
    return function + tuple_of(*arguments) + b"R"


def dtype(spec, state=None):
    made = call(name("numpy", "dtype"), text(spec), b"\x89", b"\x88")
    return made if state is None else made + state + b"b"


NDARRAY = name("numpy", "ndarray")
RECONSTRUCT = name("numpy.core.multiarray", "_reconstruct")
SCALAR = name("numpy.core.multiarray", "scalar")
PLAIN = tuple_of(number(3), text("<"), b"N", b"N", b"N", number(-1), number(-1), number(0))
POINTER = octets(b"\x41" * 8)


def array(shape, of, data, version=1):
    empty = call(RECONSTRUCT, NDARRAY, tuple_of(number(0)), octets(b"b"))
    return empty + tuple_of(number(version), tuple_of(*map(number, shape)), of, b"\x89", data) + b"b"


def observation(**attributes):
    """A demonstration of one observation with these attributes, each given by its instructions."""
    made = name("rlbench.backend.observation", "Observation") + b")\x81"
    items = b"".join(text(key) + value for key, value in attributes.items())
    return b"\x80\x03]" + made + b"}(" + items + b"uba."


ATTACKS = {
    "array of objects from bytes": observation(gripper_pose=call(NDARRAY, tuple_of(number(1)), dtype("O"), POINTER)),
    "array of objects by its state": observation(gripper_pose=array((1,), dtype("O8"), POINTER)),
    "type whose state makes it one of objects": observation(
        gripper_pose=array(
            (1,),
            dtype("V8", tuple_of(number(3), text("|"), b"N", b"N", b"N", number(8), number(8), number(63))),
            POINTER,
        )
    ),
    "type with a subtype": observation(
        gripper_pose=array(
            (1,),
            dtype(
                "f8",
                tuple_of(
                    number(3), text("<"), tuple_of(dtype("O"), tuple_of(number(1))), b"N", b"N", *[number(-1)] * 3
                ),
            ),
            POINTER,
        )
    ),
    "shape beyond its bytes": observation(gripper_pose=array((1 << 30, 1 << 30), dtype("f8", PLAIN), POINTER)),
    "negative shape": observation(gripper_pose=array((-1, -8), dtype("f8", PLAIN), POINTER)),
    "scalar of an object": observation(gripper_open=call(SCALAR, dtype("O"), POINTER)),
    "class that is changed": b"\x80\x03" + name("rlbench.demo", "Demo") + b"N}(" + text("__init__") + b"Nu\x86b.",
    "function of the system": b"\x80\x03" + call(name("posix", "system"), text("true")) + b".",
    "memo of a gigabyte": b"\x80\x03N" + b"r" + struct.pack("<I", 1 << 28) + b".",
    "depth without end": b"\x80\x03" + b"(" * 100_000 + b"t" * 100_000 + b".",
}


def readable(data):
    """Whether the instructions themselves are in order."""
    return bool(list(pickletools.genops(data)))
