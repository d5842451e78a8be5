from aerodaas import *
from aerodaas.analytics import *

env: IEnvironment = Environment("environment.json")
edge_compute: ICompute = env.getComputeResourceById("edge_cloud")
drone: IRobot = env.getRobotById("tello")
scheduler = NearestNeighborScheduler(env)
env.setTrajectoryScheduler(scheduler)
camera: IPushSensor[Image] = drone.getSensorById("tello_cam1")
camera_data_stream: AeroStreamData[Image] = camera.getDataStream()
# Detect VIP from camera feed
vip_detect_analytics: IAnalyse = VipDetectionAnalytics()
vip_detect_analytics.deploy(edge_compute)
vip_detect_data_stream: AeroStreamData[Bbox] = vip_detect_analytics.analyse(camera_data_stream)
# Follow VIP based on bounding box
vip_follow_analytics: INavigableAnalyse = VipFollowAnalytics()
vip_follow_analytics.deploy(edge_compute)
vip_nav_data: IAeroData[AeroNavigation] = vip_follow_analytics.analyse(vip_detect_data_stream)
# Identify bodypose of VIP to send alert
vip_body_pose_analytics: IAnalyse = BodyPoseEmergencyAnalytics()
vip_body_pose_analytics.deploy(edge_compute)
vip_body_pose_data_stream: AeroStreamData[Bbox] = vip_body_pose_analytics.analyse(camera_data_stream)
# Send navigation commands to drone
drone_nav_data: AeroNavigation = scheduler.generateNavigation(vip_nav_data)
drone.navigate(drone_nav_data)
drone.start_mission()
