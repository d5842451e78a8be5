from .analytics.base import Analytics as Analytics
from .analytics.base import NavigableAnalytics as NavigableAnalytics
from .analytics.monitoring import MonitoringAnalytics as MonitoringAnalytics
from .data import (
    AeroData as AeroData,
)
from .data import (
    AeroListData as AeroListData,
)
from .data import (
    Alert as Alert,
)
from .data import (
    Battery as Battery,
)
from .data import (
    Bbox as Bbox,
)
from .data import (
    Detection as Detection,
)
from .data import (
    Detections as Detections,
)
from .data import (
    Frame as Frame,
)
from .data import (
    GpsFix as GpsFix,
)
from .data import (
    Header as Header,
)
from .data import (
    Image as Image,
)
from .data import (
    Odom as Odom,
)
from .data import (
    Odometry as Odometry,
)
from .environment import Environment as Environment
from .environment import Robot as Robot
from .errors import AeroDaaSError as AeroDaaSError
from .graph import AeroStreamData as AeroStreamData
from .interfaces import (
    IAeroData as IAeroData,
)
from .interfaces import (
    IAnalyse as IAnalyse,
)
from .interfaces import (
    ICompute as ICompute,
)
from .interfaces import (
    IDeployable as IDeployable,
)
from .interfaces import (
    IEnvironment as IEnvironment,
)
from .interfaces import (
    INavigableAnalyse as INavigableAnalyse,
)
from .interfaces import (
    INavigate as INavigate,
)
from .interfaces import (
    IPullSensor as IPullSensor,
)
from .interfaces import (
    IPushSensor as IPushSensor,
)
from .interfaces import (
    IRobot as IRobot,
)
from .interfaces import (
    ISensor as ISensor,
)
from .schedulers.waypoint.base import TrajectoryScheduler as TrajectoryScheduler
from .schedulers.waypoint.nearest_neighbor import (
    NearestNeighborScheduler as NearestNeighborScheduler,
)
from .schedulers.waypoint.ordered import OrderedScheduler as OrderedScheduler
from .waypoints import (
    AeroNavigation as AeroNavigation,
)
from .waypoints import (
    NavigationType as NavigationType,
)
from .waypoints import (
    PriorityQueue as PriorityQueue,
)
from .waypoints import (
    SchedulingType as SchedulingType,
)
from .waypoints import (
    VelocityCommand as VelocityCommand,
)
from .waypoints import (
    Waypoint as Waypoint,
)
from .waypoints import (
    WaypointType as WaypointType,
)
