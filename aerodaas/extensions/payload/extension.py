"""What a gimbal and a camera add to the core: both themselves, actions, and what performs them."""

from aerodaas.config.extensions import Extension

EXTENSION = Extension(
    name="payload",
    summary="Gimbal, pictures, video, zoom and focus in a mission.",
    settings={"mission": "aerodaas.extensions.payload.settings:PayloadMission"},
    recorded_settings=("robots[].mission.photo_timeout",),
    mavlink_components=("aerodaas.extensions.payload.mavlink.component:MavlinkPayload",),
    simulated_equipment=("aerodaas.extensions.payload.simulated:SimulatedPayload",),
    sidecar_writers=("aerodaas.extensions.payload.photo_album:PhotoAlbum",),
    actions=(
        "aerodaas.extensions.payload.actions:TriggerPhotos",
        "aerodaas.extensions.payload.actions:LookAt",
        "aerodaas.extensions.payload.actions:AimGimbal",
        "aerodaas.extensions.payload.actions:SetLens",
        "aerodaas.extensions.payload.actions:TakePhoto",
        "aerodaas.extensions.payload.actions:RecordVideo",
    ),
    action_executors=("aerodaas.extensions.payload.photographer:Photographer",),
)
