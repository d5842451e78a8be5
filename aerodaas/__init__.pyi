from .analytics.base import Analytics as Analytics, NavigableAnalytics as NavigableAnalytics
from .data import (
    AeroData as AeroData,
    AeroListData as AeroListData,
    Alert as Alert,
    Battery as Battery,
    Bbox as Bbox,
    Detection as Detection,
    Detections as Detections,
    Frame as Frame,
    GpsFix as GpsFix,
    Header as Header,
    Image as Image,
    Odom as Odom,
    Odometry as Odometry,
)
from .environment import Environment as Environment, Robot as Robot
from .errors import AeroDaaSError as AeroDaaSError
from .graph import AeroStreamData as AeroStreamData
from .interfaces import (
    IAeroData as IAeroData,
    IAnalyse as IAnalyse,
    ICompute as ICompute,
    IDeployable as IDeployable,
    IEnvironment as IEnvironment,
    INavigableAnalyse as INavigableAnalyse,
    INavigate as INavigate,
    IPullSensor as IPullSensor,
    IPushSensor as IPushSensor,
    IRobot as IRobot,
    ISensor as ISensor,
)
from .schedulers.waypoint.base import TrajectoryScheduler as TrajectoryScheduler
from .schedulers.waypoint.nearest_neighbor import (
    NearestNeighborScheduler as NearestNeighborScheduler,
)
from .schedulers.waypoint.ordered import OrderedScheduler as OrderedScheduler
from .waypoints import (
    AeroNavigation as AeroNavigation,
    NavigationType as NavigationType,
    PriorityQueue as PriorityQueue,
    SchedulingType as SchedulingType,
    VelocityCommand as VelocityCommand,
    Waypoint as Waypoint,
    WaypointType as WaypointType,
)
