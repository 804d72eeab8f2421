"""The subset of GBNF that our grammars use -> one regular expression."""

import re

_RULE = re.compile(r"(\w+) ::= (.*)")
_TOKEN = re.compile(r'"([^"\\]|\\n)*"|\[[^\]]*\]|\{\d+,\d+\}|\w+|[()|?]| +')


def matches(grammar, text):
    """Whether the whole of `text` follows the grammar."""
    rules = dict(_RULE.fullmatch(line).groups() for line in grammar.splitlines())
    return re.fullmatch(_regex(rules, "root"), text) is not None


def _regex(rules, name):
    body, position, parts = rules[name], 0, []
    while position < len(body):
        token = _TOKEN.match(body, position)
        parts.append(_translated(rules, token.group()))
        position = token.end()
    return "(?:" + "".join(parts) + ")"


def _translated(rules, token):
    if token.startswith('"'):
        return "(?:" + re.escape(token[1:-1].replace(r"\n", "\n")) + ")"
    if token == "(":
        return "(?:"
    return _regex(rules, token) if token.isidentifier() else token.strip()
