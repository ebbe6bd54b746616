"""The story: the page as it opens, every number of it read from the summary.

numbers   a number with its place in the summary
facts     what the screens say, from the summary and the tables of the figures
"""
