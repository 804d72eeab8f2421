"""What people say -> an `Order`: words -> noun phrases -> clauses -> sentences -> what was taught, about which objects.

`words` cuts the text and `lexicon` knows the words of a task; `noun_phrases` finds the object that a stretch of words
stands for, by `descriptions` and relations in `space`; `clause_parser` finds `clauses`, each a verb with its objects in
their roles; `sentences` keeps what is to be done and leaves out what is forbidden; `reading` puts the clauses into the
frames of `taught` instructions, or says why that fails. `vocabulary` and `verbs` are the English that all tasks share.
"""
