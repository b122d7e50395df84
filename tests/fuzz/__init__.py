"""Broken files by the thousand: every one must end in a result or in words that name the cause.

A kind of case (``loaders``, ``programs``) is an iterator of named bytes and a way to use them.  A child
process takes one after another under limits of time and memory and judges each; its parent starts another where one
dies, and keeps the file of every case that fails.  By hand::

    python -m tests.fuzz --kind loaders --seed 7 --cases 300
"""
