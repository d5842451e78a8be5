"""What the Tello adds to the core: a driver, its camera, and how it is found."""

from aerodaas.config.extensions import Extension, VehicleKind

EXTENSION = Extension(
    name="tello",
    summary="DJI Ryze Tello and Tello EDU by their SDK.",
    plugins={
        "drivers": {"tello": "aerodaas.extensions.tello.vehicle:TelloVehicle"},
        "cameras": {"tello": "aerodaas.extensions.tello.camera:TelloCamera"},
    },
    vehicles=(
        VehicleKind(
            "tello",
            driver="tello",
            limits={"takeoff_height": 1.2, "cruise_speed": 0.4, "max_speed": 1.0},
            fence=(5, 3),
            address="192.168.10.1",
            address_setting="address",
            camera={},
            find="aerodaas.extensions.tello.discovery:find_tello",
        ),
    ),
    ports={8890: "Tello state", 11111: "Tello video"},
)
