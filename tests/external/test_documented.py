"""Pages whose commands take minutes: are the numbers on them those that the programs print?"""

from conftest import program, succeed

# Two pages with some twenty comparisons, diagnoses and rehearsals between them.
DEADLINE_S = 1800


def test_numbers_on_long_pages_are_those_that_the_documented_commands_print():
    succeed([program("documented")], DEADLINE_S)
