// Data sources of a page: one flight's live socket, a provider's fleet, or a recording (playback.ts).

import { type LiveMessage, LiveSocket } from "./connection";
import type { AlertLog } from "./alerts";
import type { Sample } from "./flight";
import type { Spot } from "./place";
import type { AnalyticsOut, ItemMessage, MissionOut, RobotOut } from "./wire";
import { pictureForm } from "./video_decoder";

/** What came before a moment of a recording; its charts have what comes after it, too. */
export interface Past {
  trails: Map<string, Spot[]>;
  history: Map<string, Sample[]>;
  log: AlertLog;
  analytics: AnalyticsOut[];
}

/** What a source has at one moment. */
export interface Snapshot {
  /** The mission that is shown, or all of a provider. */
  missions: MissionOut[];
  /** A provider's drones, also those on the ground; empty elsewhere. */
  robots: RobotOut[];
  /** The server's time, nanoseconds; null where it is not known. */
  now: number | null;
  /** Of a recording. */
  past?: Past;
}

export interface StateListener {
  onState(snapshot: Snapshot): void;
  onConnected(connected: boolean): void;
  onEnd(): void;
}

export interface PictureListener {
  /** A picture, its depth, or what was found in it, which may come before the picture. */
  onItem(message: ItemMessage, blob: ArrayBuffer | null): void | Promise<void>;
  /** There is no picture at this moment. */
  onNothing(): void;
  /** The server's time, nanoseconds. */
  onTime(now: number): void;
}

/** Which pictures are watched. */
export interface Watched {
  mission: string;
  camera: string;
  /** Streams of what was found. */
  finders: string[];
  /** Whether the depth is wanted, too. */
  depth: boolean;
}

export interface Source {
  readonly kind: "live" | "fleet" | "recording";
  /** Send the state to a listener from now on. */
  follow(listener: StateListener): void;
  /** Send pictures to a listener until the returned function is called. */
  watch(watched: Watched, listener: PictureListener): () => void;
  close(): void;
}

function livePath(mission: string, words: Record<string, string>): string {
  return `v1/missions/${mission}/live?${new URLSearchParams(words)}`;
}

/** Watch a camera of a mission in flight. */
function watchLive({ mission, camera, finders, depth }: Watched, listener: PictureListener): () => void {
  const words = { rate: "1", streams: [camera, ...finders].join(","), ...(depth && { depth: camera }) };
  let socket: LiveSocket | undefined;
  let gone = false;
  const onMessage = (message: LiveMessage, blob: ArrayBuffer | null) => {
    if (message.kind === "mission") listener.onTime(message.now);
    if (message.kind === "item") void listener.onItem(message, blob);
  };
  void pictureForm().then((pictures) => {
    if (!gone) socket = new LiveSocket(livePath(mission, { ...words, pictures }), { onMessage });
  });
  return () => {
    gone = true;
    socket?.close();
  };
}

/** One mission in flight. */
export class LiveSource implements Source {
  readonly kind = "live";
  readonly watch = watchLive;
  private socket: LiveSocket | undefined;

  constructor(private readonly mission: string) {}

  follow(listener: StateListener): void {
    this.socket = new LiveSocket(livePath(this.mission, { rate: "10" }), {
      onMessage: (message) => {
        if (message.kind === "end") listener.onEnd();
        if (message.kind !== "mission") return;
        listener.onState({ missions: [message.mission], robots: [], now: message.now });
      },
      onConnected: (connected) => listener.onConnected(connected),
    });
  }

  close(): void {
    this.socket?.close();
  }
}

/** A provider's fleet, by the answers that the page polls. */
export class FleetSource implements Source {
  readonly kind = "fleet";
  readonly watch = watchLive;
  private listener: StateListener | undefined;

  follow(listener: StateListener): void {
    this.listener = listener;
    listener.onConnected(true);
  }

  update(snapshot: Snapshot): void {
    this.listener?.onState(snapshot);
  }

  close(): void {
    this.listener = undefined;
  }
}
