"""How does an engine bounce? A body dropped on a floor, asked of any engine and held against exact answers.

Nothing here knows the bottle. An engine's author writes one function (``flipproof.bounce.adapter``), and
``flipproof bounce`` measures a passport with it (``flipproof.bounce.passport``).
"""
