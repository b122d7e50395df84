"""Pictures, contact sheets and pages of shapes and programs, drawn without a GPU or a display."""

from shapeprog.view.page import Item, contact_sheet, picture
from shapeprog.view.viewer import viewer

__all__ = ["Item", "contact_sheet", "picture", "viewer"]
