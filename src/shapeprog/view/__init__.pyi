from .page import Item, contact_sheet, picture
from .viewer import viewer

__all__ = ["Item", "contact_sheet", "picture", "viewer"]
