"""Pictures, contact sheets and pages of shapes and programs, drawn without a GPU or a display."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
