// Tiles in one file: a PMTiles archive, of which the parts that are looked at are fetched by ranges.

import { Compression, FetchSource, PMTiles, SharedPromiseCache } from "pmtiles";
import { useEffect, useState } from "preact/hooks";
import { messageOf, token } from "./connection";
import type { TilesOut } from "./wire";

/** Kinds of pictures by their number in the archive's header. */
const KINDS = new Map([[2, "image/png"], [3, "image/jpeg"], [4, "image/webp"], [5, "image/avif"]]);
/** Tiles whose pictures are kept; a wall's screen shows a hundred. */
const KEPT = 400;
/** Directories that are kept, each of a few kilobytes. */
const KEPT_PARTS = 100;

/** Unpack a part of an archive; a browser's own word for a damaged one is that it cannot fetch. */
async function unpacked(part: ArrayBuffer, packing: Compression): Promise<ArrayBuffer> {
  if (packing === Compression.None || packing === Compression.Unknown) return part;
  if (packing !== Compression.Gzip) throw new Error("it is packed by something else than gzip");
  const stream = new Blob([part]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer().catch(() => {
    throw new Error("a part of it is damaged");
  });
}

export class TileArchive {
  private readonly pictures = new Map<string, Promise<string>>();

  constructor(
    private readonly archive: PMTiles,
    private readonly kind: string,
    /** Told why a part of the archive cannot be read. */
    private readonly broken: (error: unknown) => void,
  ) {}

  /** The address of a tile's picture; empty where there is none. */
  picture(level: number, column: number, row: number): Promise<string> {
    const key = `${level}/${column}/${row}`;
    const known = this.pictures.get(key);
    if (known) return known;
    const found = this.archive
      .getZxy(level, column, row)
      .then((tile) => (tile ? URL.createObjectURL(new Blob([tile.data], { type: this.kind })) : ""))
      .catch((error: unknown) => {
        // What was not there may be there at the next look.
        this.pictures.delete(key);
        this.broken(error);
        return "";
      });
    this.pictures.set(key, found);
    for (const old of [...this.pictures.keys()].slice(0, -KEPT)) this.forget(old);
    return found;
  }

  close(): void {
    for (const key of [...this.pictures.keys()]) this.forget(key);
  }

  private forget(key: string): void {
    void this.pictures.get(key)?.then((url) => url && URL.revokeObjectURL(url));
    this.pictures.delete(key);
  }
}

interface ShownMap {
  /** The tiles that can be drawn. */
  tiles: TilesOut | null;
  archive: TileArchive | null;
  /** Why there are none, or some are missing. */
  problem: string;
}

/** The tiles of a flight: those with an address each at once, an archive's once it is opened. */
export function useArchive(tiles: TilesOut | null): ShownMap {
  const [shown, setShown] = useState<ShownMap | null>(null);
  useEffect(() => {
    setShown(null);
    if (!tiles?.archive) return;
    let opened: TileArchive | null = null;
    let gone = false;
    const broken = (error: unknown) => {
      const problem = `the map's archive ${nameOf(tiles)} cannot be read: ${messageOf(error)}`;
      if (!gone) setShown((before) => ({ tiles: null, archive: null, ...before, problem }));
    };
    // Nobody else is told the token.
    const own = new URL(tiles.url, document.baseURI).origin === location.origin;
    const headers = new Headers(own ? { Authorization: `Bearer ${token()}` } : {});
    const archive = new PMTiles(
      new FetchSource(tiles.url, headers),
      new SharedPromiseCache(KEPT_PARTS, true, unpacked),
      unpacked,
    );
    archive
      .getHeader()
      .then(({ tileType, maxZoom }) => {
        const kind = KINDS.get(tileType);
        if (kind === undefined) throw new Error("it holds vectors; an archive of pictures is needed");
        if (gone) return;
        opened = new TileArchive(archive, kind, broken);
        const finest = Math.min(tiles.max_zoom, maxZoom);
        setShown({ tiles: { ...tiles, max_zoom: finest }, archive: opened, problem: "" });
      })
      .catch(broken);
    return () => {
      gone = true;
      opened?.close();
    };
  }, [tiles]);
  if (tiles?.archive) return shown ?? { tiles: null, archive: null, problem: "" };
  return { tiles, archive: null, problem: "" };
}

function nameOf({ url }: TilesOut): string {
  return url.split("/").at(-1)?.split("?")[0] ?? "";
}
