"""What Schemathesis does not know by itself."""

import msgpack
import schemathesis


@schemathesis.serializer("application/msgpack")
def msgpack_body(_, value):
    return msgpack.packb(value, default=str)  # integers beyond 64 bits, which the format cannot say
