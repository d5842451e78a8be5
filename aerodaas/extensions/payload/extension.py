"""What a gimbal and a camera add to the core: actions of waypoints, and what performs them."""

from aerodaas.config.extensions import Extension

EXTENSION = Extension(
    name="payload",
    summary="Gimbal, pictures, video, zoom and focus in a mission.",
    settings={"mission": "aerodaas.extensions.payload.settings:PayloadMission"},
    recorded_settings=("robots[].mission.photo_timeout",),
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
