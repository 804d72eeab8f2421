"""How the text of an instruction becomes an `Order`, or a refusal. Each step is a module:

    text
      -> words             words, lexicon         base forms, spelling corrected to the words of the task
      -> noun phrases      noun_phrases           determiner, adjectives and noun describe an object (descriptions)
                           post_modifiers         "that is red", "next to the plate": relations in space
      -> lists             coordination           "the red and the blue button", "all mugs"
      -> clauses           clause_parser          a verb, objects in roles, fixed words: a `ParsedClause` (clauses)
      -> a sentence        sentences              the clauses to carry out, in their order, without what is forbidden
      -> frames            reading                each clause put into a frame (frames) of what was taught (taught),
                                                  if the sequence is possible (sequence)
      -> `Order`           order                  the canonical text, its clauses and objects

    or a refusal           refusals               which words are not understood, and what the task knows

Every step yields all of its parses, and every word must have a place in one. Parses of one meaning are an order; none,
or several meanings, is a refusal. `vocabulary` and `verbs` are the closed classes of English that all tasks share.
"""
