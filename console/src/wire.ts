// Made from wire.schema.json by types.mjs; not to be edited.

/**
 * Role of an account; each role may do what those before it may.
 */
export type Role = "viewer" | "pilot" | "operator" | "admin";
/**
 * Purpose of a token, within its account's role.
 */
export type Scope = "fly" | "sense" | "compute";
/**
 * Verdict of an item on a take-off.
 */
export type Verdict = "good" | "warning" | "refused" | "unknown";
/**
 * How sure a follower is of its target in one frame.
 */
export type TargetState = "sure" | "likely" | "uncertain" | "unseen";
/**
 * State of a submitted mission at the service; its drones have states of their own.
 */
export type MissionPhase =
  | "submitted"
  | "rehearsing"
  | "awaiting_approval"
  | "queued"
  | "flying"
  | "landed"
  | "refused"
  | "cancelled"
  | "failed";
/**
 * Reference of a waypoint's z, whatever its x and y are.
 */
export type HeightReference = "home" | "sea" | "ground";
/**
 * The reference of a waypoint's x, y and z.
 */
export type WaypointType = "relative" | "local" | "global" | "global_relative";
/**
 * The 13 states of a mission (the paper's stat-stream).
 */
export type MissionState =
  | "idle"
  | "preflight"
  | "taking_off"
  | "holding"
  | "enroute"
  | "loitering"
  | "following"
  | "diverted"
  | "paused"
  | "returning"
  | "landing"
  | "landed"
  | "aborted";
/**
 * How a flight ended, as reported by a driver that can tell.
 */
export type FlightEnd = "landed" | "fell" | "unheard";
/**
 * The vehicle's flight mode, as it reports it.
 */
export type VehicleMode =
  | "grounded"
  | "taking_off"
  | "guided"
  | "holding"
  | "mission"
  | "returning"
  | "landing"
  | "manual"
  | "failsafe"
  | "lost";
/**
 * Kind of items of a stream that a page can draw.
 */
export type StreamKind = "pictures" | "detections" | "navigation";

export interface Wire {
  AccountOut: AccountOut;
  Answer: Answer;
  CameraConfig: CameraConfig;
  CommandIn: CommandIn;
  ControlsOut: ControlsOut;
  EndMessage: EndMessage;
  FleetOut: FleetOut;
  HealthReport: HealthReport;
  ItemMessage: ItemMessage;
  LeftOutMessage: LeftOutMessage;
  MissionOut: MissionOut;
  NavigationIn: NavigationIn;
  PlaybackOut: PlaybackOut;
  RearrangeIn: RearrangeIn;
  RefusalOut: RefusalOut;
  RobotConfig: RobotConfig;
  SceneryOut: SceneryOut1;
  StateMessage: StateMessage;
  SteerIn: SteerIn;
  SurveyIn: SurveyIn;
  SurveyOut: SurveyOut;
}
/**
 * An account.
 */
export interface AccountOut {
  created: number;
  disabled: boolean;
  name: string;
  role: Role;
  scopes: Scope[];
  tenant: string;
}
/**
 * The mission's answer to a command.
 */
export interface Answer {
  accepted: boolean;
  refused: {
    [k: string]: string;
  };
  text: string;
}
/**
 * The settings of a camera, from `SensorConfig.settings`.
 */
export interface CameraConfig {
  depth_range: number | null;
  gimbal: GimbalConfig | null;
  height: number;
  horizontal_fov: number;
  loop: boolean;
  /**
   * @minItems 3
   * @maxItems 3
   */
  mount: [number, number, number];
  path: string | null;
  photo_interval: number | null;
  pitch: number;
  topic: string | null;
  width: number;
  yaw: number;
  zoom: number;
}
/**
 * The gimbal of a camera, which keeps it to the horizon.
 */
export interface GimbalConfig {
  highest: number;
  lowest: number;
  max_rate: number;
  widest: number;
}
/**
 * A command to one robot of a mission.
 */
export interface CommandIn {
  command: "pause" | "resume" | "clear" | "return-home" | "land";
  robot: string;
}
/**
 * Answer to a velocity by hand.
 */
export interface ControlsOut {
  at: number;
  held: boolean;
  text: string;
}
/**
 * The mission is over; nothing follows.
 */
export interface EndMessage {
  kind: "end";
}
/**
 * The fleet, and the environment that an application's graph is built against.
 */
export interface FleetOut {
  environment: {
    [k: string]: unknown;
  };
  name: string;
  robots: RobotOut[];
}
/**
 * One drone of the fleet.
 */
export interface RobotOut {
  area: [number, number][] | null;
  battery: number | null;
  enabled: boolean;
  faults: string[];
  heard: number | null;
  id: string;
  lease: string | null;
  /**
   * State of the link to a drone: who is connected, and whether it answers.
   */
  link: "unwatched" | "connecting" | "connected" | "mission" | "lost";
  mission: string | null;
  mode: string;
  objection: string;
  position: [number, number, number] | null;
  preflight: Verdict | null;
  sensors: string[];
  shared: string[];
  since: number | null;
  tenant: string | null;
}
/**
 * A robot's list before take-off, as it was examined last.
 */
export interface HealthReport {
  age: number | null;
  items: HealthItem[];
}
/**
 * One item of the list before take-off.
 */
export interface HealthItem {
  bound: string;
  name: string;
  remedy: string;
  value: string;
  verdict: Verdict;
}
/**
 * An item of one of the flight's streams.
 */
export interface ItemMessage {
  blob: boolean;
  captured: number;
  item: PictureItem | DepthItem | TargetItem | FoundItem;
  key: boolean;
  kind: "item";
  places: ([number, number, number, number, number, number] | null)[];
  stamp: number;
  stream: string;
}
/**
 * A picture of a camera; its bytes follow the message.
 */
export interface PictureItem {
  /**
   * @minItems 1
   * @maxItems 1
   */
  bytes: [number];
  depth: boolean;
  format: "jpeg" | "h264";
  header: {
    id: number;
    source: string;
    stamp: number;
  };
  is: "Picture";
}
/**
 * The depth measured with a picture, as a grey PNG whose bytes follow the message.
 */
export interface DepthItem {
  /**
   * @minItems 1
   * @maxItems 1
   */
  bytes: [number];
  header: {
    id: number;
    source: string;
    stamp: number;
  };
  is: "Depth";
  range: number;
}
/**
 * Target that a drone follows, in the frame that its command was made from.
 */
export interface TargetItem {
  header: {
    id: number;
    source: string;
    stamp: number;
  };
  is: "Target";
  of: FollowedTarget;
}
/**
 * The target of a velocity command. Its frame is the one that the command was made from.
 */
export interface FollowedTarget {
  box: [number, number, number, number] | null;
  state: TargetState;
  track_id: number | null;
}
/**
 * Detections of an analysis in a frame.
 */
export interface FoundItem {
  is: "Detections";
  of: Detections;
}
/**
 * All detections in one frame, best first, with that frame's metadata.
 */
export interface Detections {
  camera: CameraModel | null;
  header: {
    id: number;
    source: string;
    stamp: number;
  };
  height: number;
  items: Detection[];
  nearest: number[][] | null;
  odometry: Odometry | null;
  width: number;
}
/**
 * A pinhole camera bolted to a body: intrinsics in pixels, mount in metres and radians.
 *
 * The optical frame is x right, y down, z forward. `mount` is the camera's place in the body
 * frame (FLU); `pitch` tilts it down when positive, `yaw` turns it left when positive, `roll`
 * lowers its right side when positive.
 */
export interface CameraModel {
  cx: number;
  cy: number;
  fx: number;
  fy: number;
  height: number;
  /**
   * @minItems 3
   * @maxItems 3
   */
  mount: [number, number, number];
  pitch: number;
  roll: number;
  width: number;
  yaw: number;
}
/**
 * One object found in a frame; the box is in the frame's own pixels.
 *
 * Raises ValueError for key points or an appearance of another size.
 */
export interface Detection {
  appearance: string | null;
  /**
   * @minItems 4
   * @maxItems 4
   */
  box: [number | null, number | null, number | null, number | null];
  depth: number | null;
  keypoints: [number | null, number | null, number | null][] | null;
  label: string;
  score: number | null;
  track_id: number | null;
}
/**
 * Where the vehicle believes it is: ENU position and velocity, attitude and body rates.
 */
export interface Odometry {
  pitch: number | null;
  position: {
    x: number | null;
    y: number | null;
    z: number | null;
  };
  position_sigma: number | null;
  roll: number | null;
  velocity: {
    x: number | null;
    y: number | null;
    z: number | null;
  };
  yaw: number | null;
  yaw_rate: number | null;
}
/**
 * In place of an item that cannot be sent.
 */
export interface LeftOutMessage {
  kind: "left_out";
  reason: string;
  stream: string;
}
/**
 * A mission and its newest state.
 */
export interface MissionOut {
  account: string;
  alerts: string[];
  analytics: AnalyticsOut | null;
  attach: string | null;
  ended: number | null;
  grants: {
    [k: string]: string[];
  };
  id: string;
  lease: string | null;
  name: string;
  phase: MissionPhase;
  places: {
    [k: string]: {
      /**
       * @minItems 3
       * @maxItems 3
       */
      [k: string]: [number, number, number];
    };
  };
  reason: string;
  recording: boolean;
  robots: string[];
  share: string[];
  started: number | null;
  status: {
    [k: string]: RobotStatus;
  };
  streams: {
    [k: string]: StreamKind;
  };
  submitted: number;
  tenant: string;
  told: {
    [k: string]: number;
  };
  verdict: VerdictOut | null;
}
/**
 * Sums over the tasks of the analytics scheduler, from the start up to one time.
 */
export interface AnalyticsOut {
  cloud: number;
  dropped: number;
  edge: number;
  in_time: number;
  late: number;
  qoe: number;
  qos: number;
  time: number;
}
/**
 * Status of one robot at one time: of its mission and of its vehicle.
 */
export interface RobotStatus {
  mission: MissionStatus;
  vehicle: VehicleState | null;
}
/**
 * The mission at one moment.
 */
export interface MissionStatus {
  distance: number | null;
  faults: string[];
  given_up: string[];
  outlook: BatteryOutlook | null;
  pending: Waypoint[];
  /**
   * @minItems 2
   * @maxItems 2
   */
  photos: [number, number];
  pilot: string;
  reason: string;
  stamp: number;
  state: MissionState;
  target: Waypoint | null;
  unfinished: string;
  visited: string[];
  visits: number;
  /**
   * @minItems 2
   * @maxItems 2
   */
  waypoint_counts: [number, number];
}
/**
 * How far the battery lasts, by the energy model as this flight scaled it; charges 0 to 1.
 */
export interface BatteryOutlook {
  hover: number | null;
  plan: number | null;
  returns_at: number | null;
}
/**
 * A place to fly to, with hover time, yaw, speed and priority.
 *
 * Raises InvalidWaypointError for numbers that are not finite or out of range.
 */
export interface Waypoint {
  above?: HeightReference | string | null;
  actions?: (TriggerPhotos | LookAt | AimGimbal | SetLens | TakePhoto | RecordVideo | MoveActuator)[];
  deadline?: number | null;
  hover_duration?: number;
  id: string;
  priority?: number;
  speed?: number | null;
  waypoint_type?: WaypointType | string;
  x: number;
  y: number;
  yaw?: number | null;
  z: number;
}
/**
 * Take pictures on the way to the waypoint, by distance or by time, without a stop.
 */
export interface TriggerPhotos {
  distance?: number | null;
  interval?: number | null;
  type?: "trigger_photos";
}
/**
 * Keep the gimbal, or the nose where the gimbal cannot turn, on a place.
 *
 * From the way to the waypoint on, until one has another place or turns the gimbal.
 */
export interface LookAt {
  type?: "look_at";
  x: number;
  y: number;
  z: number;
}
/**
 * Turn the gimbal on the way to the waypoint.
 */
export interface AimGimbal {
  pitch?: number;
  type?: "aim_gimbal";
  yaw?: number;
}
/**
 * Set the camera's zoom and focus on the way to the waypoint; None leaves one as it is.
 */
export interface SetLens {
  focus?: number | null;
  type?: "set_lens";
  zoom?: number | null;
}
/**
 * Take one picture at the waypoint, once the gimbal looks where it is to.
 */
export interface TakePhoto {
  type?: "take_photo";
}
/**
 * Begin or end the camera's recording on its own card, at the waypoint after the picture.
 *
 * A recording that the mission has begun ends with it.
 */
export interface RecordVideo {
  on?: boolean;
  type?: "record_video";
}
/**
 * Have an actuator take a position at the waypoint, after picture and video.
 */
export interface MoveActuator {
  actuator: string;
  position: string;
  type?: "move_actuator";
}
/**
 * The newest knowledge about a vehicle.
 */
export interface VehicleState {
  actuators: {
    [k: string]: string;
  };
  armed: boolean;
  battery: Battery;
  below: number | null;
  ended: FlightEnd | null;
  extra: {
    [k: string]: number | null;
  };
  faults: string[];
  gimbal: GimbalAttitude | null;
  gps: GpsFix | null;
  mode: VehicleMode;
  odometry: Odometry;
  stamp: number;
  traffic: Traffic[];
  truth: Odometry | null;
  zoom: number | null;
}
/**
 * State of the flight battery.
 */
export interface Battery {
  current: number | null;
  fraction: number | null;
  voltage: number | null;
}
/**
 * Where a gimbal says that it looks; radians.
 */
export interface GimbalAttitude {
  pitch: number | null;
  roll: number | null;
  stamp: number;
  yaw: number | null;
}
/**
 * A global position: WGS84 degrees, metres above the ellipsoid, and its accuracy.
 */
export interface GpsFix {
  altitude: number | null;
  horizontal_sigma: number | null;
  latitude: number | null;
  longitude: number | null;
  satellites: number;
  vertical_sigma: number | null;
}
/**
 * One aircraft, where it is at the stamp of the state that it stands in.
 */
export interface Traffic {
  address: number;
  age: number | null;
  callsign: string;
  position: {
    x: number | null;
    y: number | null;
    z: number | null;
  };
  velocity: {
    x: number | null;
    y: number | null;
    z: number | null;
  };
}
/**
 * Result of the rehearsal in simulation.
 */
export interface VerdictOut {
  approved: boolean;
  battery_used: number | null;
  distance: number | null;
  picture: string | null;
  reasons: string[];
  seconds: number | null;
}
/**
 * Waypoints for one robot of a mission in flight: one command, carried out whole.
 */
export interface NavigationIn {
  clear_first?: boolean;
  deadline?: number | null;
  index?: number | null;
  ordered?: boolean;
  robot: string;
  /**
   * @minItems 1
   * @maxItems 1000
   */
  waypoints: [Waypoint, ...Waypoint[]];
}
/**
 * How far a recording has been read, and the flight once it was.
 */
export interface PlaybackOut {
  flight: RecordedOut | null;
  read: number;
}
/**
 * A recorded flight.
 */
export interface RecordedOut {
  alerts: Alert[];
  analytics: AnalyticsOut[];
  began: number;
  begin: number;
  end: number;
  environment: {
    [k: string]: unknown;
  };
  name: string;
  pictured: number | null;
  remark: string;
  scenery: SceneryOut;
  streams: {
    [k: string]: StreamKind;
  };
  tracks: {
    [k: string]: TrackOut;
  };
}
/**
 * An alert for the operator: raised by monitoring, emergencies, the watchdogs.
 */
export interface Alert {
  header: {
    id: number;
    source: string;
    stamp: number;
  };
  kind: string;
  text: string;
  values: {
    [k: string]: unknown;
  };
}
/**
 * Scenery that the map draws below a flight; empty where nothing is known.
 */
export interface SceneryOut {
  shapes: Shape[];
  tiles: TilesOut | null;
}
/**
 * One thing of the plan.
 */
export interface Shape {
  height: number;
  kind: "building" | "crops" | "fence" | "road" | "rubble" | "tower" | "tree";
  outline: [number, number][];
  width: number;
}
/**
 * Tiles of the Earth, and where the local frame lies on it.
 */
export interface TilesOut {
  archive: boolean;
  attribution: string;
  latitude: number;
  longitude: number;
  max_zoom: number;
  url: string;
}
/**
 * One robot's flight: its messages, thinned out.
 */
export interface TrackOut {
  ahead: number[];
  plans: MissionPlan[];
  states: VehicleState[];
  statuses: MissionStatus[];
}
/**
 * The waypoints ahead of a robot, local ENU.
 */
export interface MissionPlan {
  stamp: number;
  waypoints: Waypoint[];
}
/**
 * Change of the coming waypoints of one robot: one command, carried out whole.
 */
export interface RearrangeIn {
  /**
   * @maxItems 1000
   */
  order?: string[];
  /**
   * @maxItems 1000
   */
  remove?: string[];
  robot: string;
}
/**
 * Answer to each request that is not carried out, with the HTTP status.
 */
export interface RefusalOut {
  text: string;
}
/**
 * One drone of an environment, as far as the page draws it.
 */
export interface RobotConfig {
  id: string;
  limits: LimitsConfig;
  sensors: SensorConfig[];
  /**
   * @minItems 3
   * @maxItems 3
   */
  start: [number, number, number];
}
/**
 * Limits, as far as the page heeds them.
 */
export interface LimitsConfig {
  cruise_speed: number;
  geofence: GeofenceConfig;
  max_climb: number;
  max_speed: number;
  takeoff_height: number;
}
/**
 * Where the drone may be: a polygon in ENU metres, a floor and a ceiling above home.
 */
export interface GeofenceConfig {
  ceiling: number;
  floor: number;
  margin: number;
  no_fly: [number, number][][];
  polygon: [number, number][];
}
/**
 * One sensor. `driver` names a camera or reading; further settings go to that driver.
 */
export interface SensorConfig {
  driver: string | null;
  id: string;
  rate: number;
  settings: {
    [k: string]: unknown;
  };
  type: "camera" | "odometry" | "gps" | "battery" | "status";
}
/**
 * Scenery that the map draws below a flight; empty where nothing is known.
 */
export interface SceneryOut1 {
  shapes: Shape[];
  tiles: TilesOut | null;
}
/**
 * The newest state of a mission in flight.
 */
export interface StateMessage {
  kind: "mission";
  mission: MissionOut;
  now: number;
}
/**
 * A velocity by hand, in the drone's level frame; it is good for a third of a second.
 */
export interface SteerIn {
  at: number;
  forward?: number;
  left?: number;
  up?: number;
  yaw_rate?: number;
}
/**
 * Request of a plan to survey an area; nothing is flown.
 */
export interface SurveyIn {
  angle?: number | null;
  /**
   * @minItems 3
   * @maxItems 30
   */
  area: [[number, number], [number, number], [number, number], ...[number, number][]];
  around?: boolean;
  camera?: string | null;
  field_of_view?: number | null;
  front_overlap?: number;
  ground_resolution?: number | null;
  height?: number | null;
  name?: string;
  overlap?: number;
  robot: string;
  speed?: number | null;
  width?: number | null;
}
/**
 * A survey as it would be flown; its waypoints are added by `navigation`.
 */
export interface SurveyOut {
  angle: number;
  available: number | null;
  battery: number;
  height: number;
  length: number;
  photos: SurveyPhotosOut | null;
  seconds: number;
  /**
   * @minItems 3
   * @maxItems 3
   */
  start: [number, number, number];
  sweeps: number;
  waypoints: Waypoint[];
  width: number;
}
/**
 * Pictures of a survey as they would be taken.
 */
export interface SurveyPhotosOut {
  interval: number;
  line_spacing: number;
  places: [number, number][];
  resolution: number | null;
  spacing: number;
  warning: string;
}
