"""The paper: Liang 2022, with the networks and the baseline of Tian et al. 2019; see README.md in this folder.

import shapeprog as sp
generator = sp.liang2022.load_generator("fast-wide")
decoded = sp.liang2022.decode(generator, cells)  # voxels (B, 32, 32, 32)
print(sp.format_program(decoded.programs()[0]))
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
