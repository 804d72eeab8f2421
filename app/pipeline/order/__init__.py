"""How the text of an instruction becomes an `Order`, or a `Refusal`. Each stage is a module, which has its grammar:

    stage           module           rule (simplified; the module has the whole)
    tables          vocabulary       function words, prepositions, places, colors; verbs: families that mean the same
    words           words, lexicon   text = {token}; spelling corrected to the words of the task
    noun phrases    noun_phrases     noun phrase = {determiner} {modifier} {relation}
                                     what it states: descriptions, with relations in space
    clauses         clause_parser    clause = [verb] {argument}; argument = [preposition] objects | fixed word
                                     objects = noun phrase {("," | "and") noun phrase}
                                     the result: `ParsedClause` in clauses
    sentences       sentences        sentence = unit {separator unit}; unit = {lead} [forbidding words] clause
    taught forms    taught           each clause of a taught instruction is a frame, which other objects can fill
    meanings        reading          the clauses of a sentence, each put into a frame, are an `Order` (order)
                    refusals         or a `Refusal`: which phrase is not understood, and why

Each stage yields every parse, and each word must have a place in it. Parses of one meaning are an order; none, or
several meanings, are a refusal: a robot that moves to the wrong object is worse than one that asks.
"""
