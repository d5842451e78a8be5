// Tiles of a map of the Earth below the flight, each where it lies in the local frame.

import { useEffect, useMemo, useState } from "preact/hooks";
import type { Point } from "./place";
import type { Sight } from "./sight";
import { px } from "./sight";
import type { TileArchive } from "./tile_archive";
import type { TilesOut } from "./wire";

const TILE = 256;
/** Most tiles at once: a wall's screen needs a hundred. */
const MOST = 160;
/** WGS84. */
const MAJOR = 6_378_137;
const FLATTENING = 1 / 298.257223563;
const SQUARED = FLATTENING * (2 - FLATTENING);
/** Latitude, degrees, at which Web Mercator ends. */
const POLE = 85.0511;

type Vector = readonly [number, number, number];

export interface Origin {
  latitude: number;
  longitude: number;
}

/** Metres of a place on the ellipsoid in the frame of the Earth's centre. */
function centred({ latitude, longitude }: Origin): Vector {
  const [lat, lon] = [rad(latitude), rad(longitude)];
  const normal = MAJOR / Math.sqrt(1 - SQUARED * Math.sin(lat) ** 2);
  return [
    normal * Math.cos(lat) * Math.cos(lon),
    normal * Math.cos(lat) * Math.sin(lon),
    normal * (1 - SQUARED) * Math.sin(lat),
  ];
}

/** Where a place lies in the local frame: metres east and north of the origin. */
export function localOf(origin: Origin, place: Origin): Point {
  const [from, to] = [centred(origin), centred(place)];
  const way: Vector = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
  const [lat, lon] = [rad(origin.latitude), rad(origin.longitude)];
  const out = Math.cos(lon) * way[0] + Math.sin(lon) * way[1];
  return [
    Math.cos(lon) * way[1] - Math.sin(lon) * way[0],
    Math.cos(lat) * way[2] - Math.sin(lat) * out,
  ];
}

/** Column and row of a place among the tiles of a level, with fractions. */
export function tileOf({ latitude, longitude }: Origin, level: number): Point {
  const lat = rad(Math.max(-POLE, Math.min(POLE, latitude)));
  const count = 2 ** level;
  return [
    ((longitude + 180) / 360) * count,
    ((1 - Math.log(Math.tan(lat) + 1 / Math.cos(lat)) / Math.PI) / 2) * count,
  ];
}

/** The place of a tile's north-west corner. */
function cornerOf(column: number, row: number, level: number): Origin {
  const count = 2 ** level;
  return {
    latitude: (Math.atan(Math.sinh(Math.PI * (1 - (2 * row) / count))) * 180) / Math.PI,
    longitude: (column / count) * 360 - 180,
  };
}

interface Tile {
  level: number;
  column: number;
  row: number;
  /** In the local frame. */
  northWest: Point;
  southEast: Point;
}

/** The tiles that cover what is seen, at a level that has about a pixel for each of the screen. */
export function tilesOf(tiles: TilesOut, sight: Sight): Tile[] {
  const { size, view } = sight;
  const cosine = Math.cos(rad(tiles.latitude));
  const finest = Math.log2((2 * Math.PI * MAJOR * cosine * view.scale) / TILE);
  const corners = [sight.metres(0, 0), sight.metres(size.width, size.height)] as const;
  for (let level = Math.min(tiles.max_zoom, Math.max(0, Math.round(finest))); level >= 0; level--) {
    const [at, count] = [tileOf(tiles, level), 2 ** level];
    // Near the origin a tile has the same size on all sides.
    const metres = (2 * Math.PI * MAJOR * cosine) / count;
    const [west, east] = corners.map(([one]) => Math.floor(at[0] + one / metres)) as [number, number];
    const [north, south] = corners.map(([, one]) => Math.floor(at[1] - one / metres)) as [number, number];
    if ((east - west + 1) * (south - north + 1) > MOST) continue;
    const found: Tile[] = [];
    for (let row = Math.max(0, north); row <= Math.min(count - 1, south); row += 1) {
      for (let column = west; column <= east; column += 1) {
        const around = ((column % count) + count) % count;
        found.push({
          ...{ level, column: around, row },
          northWest: localOf(tiles, cornerOf(column, row, level)),
          southEast: localOf(tiles, cornerOf(column + 1, row + 1, level)),
        });
      }
    }
    return found;
  }
  return [];
}

interface TileLayerProps {
  tiles: TilesOut;
  /** The archive that they are in; null where each has an address. */
  archive: TileArchive | null;
  sight: Sight;
}

export function TileLayer({ tiles, archive, sight }: TileLayerProps) {
  const { east, north, scale } = sight.view;
  return useMemo(
    () => (
      <g class="tiles">
        {tilesOf(tiles, sight).map((tile) => {
          const { level, column, row, northWest, southEast } = tile;
          const [x, y] = [sight.x(northWest[0]), sight.y(northWest[1])];
          const place = {
            x: px(x),
            y: px(y),
            // Half a pixel more: no seams.
            width: px(sight.x(southEast[0]) - x + 0.5),
            height: px(sight.y(southEast[1]) - y + 0.5),
            preserveAspectRatio: "none",
          };
          const key = `${level}/${column}/${row}`;
          return archive ? (
            <Archived key={key} archive={archive} tile={tile} place={place} />
          ) : (
            <image key={key} href={addressOf(tiles, tile)} {...place} />
          );
        })}
      </g>
    ),
    [tiles, archive, east, north, scale, sight.size],
  );
}

function addressOf({ url }: TilesOut, { level, column, row }: Tile): string {
  return url
    .replace("{z}", String(level))
    .replace("{x}", String(column))
    .replace("{y}", String(row));
}

/** A tile of an archive; nothing where that has none. */
function Archived(props: { archive: TileArchive; tile: Tile; place: Record<string, string> }) {
  const { archive, tile, place } = props;
  const [href, setHref] = useState("");
  useEffect(() => {
    let gone = false;
    void archive
      .picture(tile.level, tile.column, tile.row)
      .then((found) => !gone && setHref(found));
    return () => {
      gone = true;
    };
  }, [archive]);
  return href ? <image href={href} data-tile={`${tile.level}/${tile.column}/${tile.row}`} {...place} /> : null;
}

function rad(degrees: number): number {
  return (degrees * Math.PI) / 180;
}
