from .base import Analytics as Analytics
from .base import NavigableAnalytics as NavigableAnalytics
from .body_pose import BodyPoseEmergencyAnalytics as BodyPoseEmergencyAnalytics
from .commanding import CommandingAnalytics as CommandingAnalytics
from .commanding import MissionLink as MissionLink
from .crowd_density import CrowdDensityAnalytics as CrowdDensityAnalytics
from .distance import DistanceAnalytics as DistanceAnalytics
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
from .gps_logger import GpsLoggerAnalytics as GpsLoggerAnalytics
from .monitoring import MonitoringAnalytics as MonitoringAnalytics
from .onnx.detector import OnnxDetector as OnnxDetector
from .pose import PoseAnalytics as PoseAnalytics
from .remote.analytics import RemoteAnalytics as RemoteAnalytics
from .synthetic import SyntheticAnalytics as SyntheticAnalytics
from .tower_inspection import TowerInspectionAnalytics as TowerInspectionAnalytics
from .tracking import TrackingAnalytics as TrackingAnalytics
from .vip_detection import VipDetectionAnalytics as VipDetectionAnalytics
