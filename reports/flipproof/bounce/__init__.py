"""How does an engine bounce? Any engine drops a body on a floor, and is compared with exact answers.

Nothing here knows the bottle. An engine's author writes one function (``flipproof.bounce.adapter``), and
``flipproof bounce`` measures a passport with it (``flipproof.bounce.passport``).
"""
