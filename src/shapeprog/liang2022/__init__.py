"""The paper: Liang 2022, with the networks and the baseline of Tian et al. 2019; see README.md in this folder.

import shapeprog as sp
generator = sp.liang2022.load_generator("tian2019-narrow")  # the paper's network; the default of commands is fast-wide
decoded = sp.liang2022.decode(generator, cells, decoder="argmax")  # voxels (B, 32, 32, 32); the default is select
print(sp.format_program(decoded.programs()[0]))

``argmax`` is the network alone, as in the paper; ``select`` reads the target when it chooses blocks.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
