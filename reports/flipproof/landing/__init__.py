"""Does it stand? Throws that scatter, landed by the thousand, and what share of them ends upright.

aim       the throw whose bottle would touch the table upright, or leaning by an offset
scatter   throws about an aim, each by its own seed; intervals of a share
work      one throw: its flight, its touch, its landing
design    which throws a study makes, as a sweep numbers them
upright   the study: aims first, then the throws themselves
"""
