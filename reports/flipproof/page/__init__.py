"""The page: templates, assets and what fills them."""
