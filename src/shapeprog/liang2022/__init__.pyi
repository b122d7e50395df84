from . import losses, prior, renderer, settings
from .adapt import AdaptTask, TargetStream, predicted_code
from .decode import decode
from .executor import NeuralExecutor
from .generator import Generator
from .loop import train
from .losses import loss
from .settings import AdaptSettings, ExecutorSettings, PretrainSettings
from .weights import build_generator, load_executor, load_generator, save_weights

__all__ = [
    "AdaptSettings", "AdaptTask", "ExecutorSettings", "Generator", "NeuralExecutor", "PretrainSettings", "TargetStream",
    "build_generator", "decode", "load_executor", "load_generator", "loss", "losses", "predicted_code", "prior",
    "renderer", "save_weights", "settings", "train",
]  # fmt: skip
