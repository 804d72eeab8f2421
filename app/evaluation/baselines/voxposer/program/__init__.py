"""The process that a language model's program runs in. Only Python's own library is imported here.

The program is never given to Python's own interpreter: `syntax` parses it and refuses what is not on a list,
`interpreter` walks what is left, and `commands` are all that it can call.
"""
