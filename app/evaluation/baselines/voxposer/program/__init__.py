"""The process that a language model's program runs in. Only Python's own library is imported here.

`syntax` refuses what is not on a list, above all attributes, by which a program could reach the process's objects;
`commands` are all that it can call; `child` gives up files, network and memory before it runs.
"""
