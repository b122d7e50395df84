"""The checker of ``--typecheck``: beartype, with whole numbers where annotations say float."""

from __future__ import annotations

from beartype import BeartypeConf, beartype

check = beartype(conf=BeartypeConf(is_pep484_tower=True))
