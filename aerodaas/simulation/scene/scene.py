"""Scene graph of a world for panda3d."""

from __future__ import annotations

import numpy as np
from panda3d.core import NodePath

from aerodaas.simulation.scenario import (
    Building,
    Car,
    CropRows,
    Fence,
    Person,
    Road,
    Rubble,
    Tower,
    Tree,
)
from aerodaas.simulation.scene.buildings import TowerLook, add_building, add_fence, add_tower
from aerodaas.simulation.scene.cars import CarFigure, CarShape
from aerodaas.simulation.scene.ground import add_field, add_ground, add_road, add_shadow
from aerodaas.simulation.scene.light import Light, sky_dome
from aerodaas.simulation.scene.people import Outfit, PersonFigure
from aerodaas.simulation.scene.plants import add_crops, add_tree
from aerodaas.simulation.scene.rubble import add_rubble
from aerodaas.simulation.scene.textures import Palette
from aerodaas.simulation.world import Thing, World, rng_of

__all__ = ["ObjectAppearance", "Scene"]


class ObjectAppearance:
    """Appearance of objects by their seeds; a subclass may vary it more."""

    def palette(self, world: World) -> Palette:
        """Textures of a world."""
        del world
        return Palette()

    def outfit(self, thing: Thing) -> Outfit:
        """Choose the outfit of a person."""
        if not isinstance(thing.spec, Person):
            raise TypeError(f"{thing.id} is no person")
        number = thing.spec.clothes
        rng = rng_of(thing) if number is None else np.random.default_rng(number)
        return Outfit.draw(thing.spec, rng)

    def car(self, thing: Thing) -> CarShape:
        """Choose the shape of a car."""
        del thing
        return CarShape()

    def tower(self, thing: Thing) -> TowerLook:
        """Choose the construction and paint of a tower."""
        del thing
        return TowerLook()


class Scene:
    """Scene nodes of a world; `update` moves the moving objects."""

    def __init__(self, world: World, appearance: ObjectAppearance | None = None) -> None:
        """Build the static objects, and the figures of moving ones."""
        self.appearance = appearance or ObjectAppearance()
        self.root = NodePath("world")
        self.palette = self.appearance.palette(world)
        self._light = Light.draw(world.scenario.sky, world.seed)
        self._sky = sky_dome(self.root, self._light)
        add_ground(self.root, world.scenario.ground.surface, self.palette, self._light)
        self._people: list[tuple[Thing, PersonFigure, NodePath]] = []
        self._cars: list[tuple[Thing, CarFigure]] = []
        for thing in world.things:
            self._add(thing)

    def _add(self, thing: Thing) -> None:
        root, palette, light, spec = self.root, self.palette, self._light, thing.spec
        if isinstance(spec, Road):
            add_road(root, spec, palette, light)
        elif isinstance(spec, CropRows):
            add_field(root, spec, palette, light)
            add_crops(root, thing, palette, light)
        elif isinstance(spec, Fence):
            add_fence(root, thing, palette, light)
        elif isinstance(spec, Tree):
            add_shadow(root, thing, palette, light)
            add_tree(root, thing, palette, light)
        elif isinstance(spec, Building):
            add_shadow(root, thing, palette, light)
            add_building(root, thing, palette, light)
        elif isinstance(spec, Rubble):
            add_shadow(root, thing, palette, light)
            add_rubble(root, thing, palette, light)
        elif isinstance(spec, Tower):
            add_shadow(root, thing, palette, light)
            add_tower(root, thing, palette, light, self.appearance.tower(thing))
        elif isinstance(spec, Car):
            car = CarFigure(root, thing, palette, self.appearance.car(thing))
            add_shadow(car.node, thing, palette, light)
            self._cars.append((thing, car))
        elif isinstance(spec, Person):
            feet = root.attach_new_node("feet")
            add_shadow(feet, thing, palette, light)
            figure = PersonFigure(root, thing, palette, self.appearance.outfit(thing))
            self._people.append((thing, figure, feet))

    def update(self, time: float, eye: tuple[float, float, float]) -> None:
        """Update the scene to a moment.

        Args:
            time: Mission time, seconds.
            eye: Place of the camera, ENU metres.
        """
        self._sky.set_pos(*eye)
        for thing, figure, feet in self._people:
            state = thing.state(time)
            figure.show(present=state.present)
            if state.present:
                figure.pose(thing.joints(time), state.yaw)
                feet.set_pos(state.x, state.y, 0.0)
                feet.show()
            else:
                feet.hide()
        for thing, car in self._cars:
            car.pose(thing.state(time))
