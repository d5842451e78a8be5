from .base import Analytics as Analytics
from .base import NavigableAnalytics as NavigableAnalytics
from .commanding import CommandingAnalytics as CommandingAnalytics
from .commanding import MissionLink as MissionLink
from .follow import FollowAnalytics as FollowAnalytics
from .followers import (
    CarFollowAnalytics as CarFollowAnalytics,
)
from .followers import (
    PersonFollowAnalytics as PersonFollowAnalytics,
)
from .followers import (
    VipFollowAnalytics as VipFollowAnalytics,
)
from .monitoring import MonitoringAnalytics as MonitoringAnalytics
from .onnx.detector import OnnxDetector as OnnxDetector
from .remote.analytics import RemoteAnalytics as RemoteAnalytics
from .synthetic import SyntheticAnalytics as SyntheticAnalytics
from .tracking import TrackingAnalytics as TrackingAnalytics
from .vip_detection import VipDetectionAnalytics as VipDetectionAnalytics
