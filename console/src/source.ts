// Where a flight's state and pictures come from: the live socket here, a recording in playback.ts.

import { LiveSocket } from "./connection";
import type { AlertLog, Sample } from "./flight";
import type { Spot } from "./place";
import { wantedForm } from "./video_pictures";
import type { AnalyticsOut, MissionOut } from "./wire";

/** What came before a moment of a recording, and of its charts what comes after it, too. */
export interface Past {
  trails: Map<string, Spot[]>;
  history: Map<string, Sample[]>;
  log: AlertLog;
  analytics: AnalyticsOut[];
}

export interface FlightEars {
  /** The newest state, at the server's time `now`, nanoseconds. */
  mission(mission: MissionOut, now: number): void;
  /** The state at a moment of a recording. */
  moment(mission: MissionOut, past: Past): void;
  end(): void;
  up(connected: boolean): void;
}

export interface ItemEars {
  /** What was found in a picture; it may come before that. */
  found(message: Record<string, unknown>): void;
  /** A picture, or the depth measured with one. */
  picture(message: Record<string, unknown>, data: ArrayBuffer): Promise<void>;
  /** There is no picture at this moment. */
  nothing(): void;
}

export interface Wanted {
  camera: string;
  /** Streams of what was found. */
  finders: string[];
  /** Whether its depth is wanted, too. */
  depth: boolean;
}

export interface Source {
  readonly recorded: boolean;
  /** Tell a flight of its state from now on. */
  follow(ears: FlightEars): void;
  /** Tell of a camera's pictures and of what `finders` find, until the answer is called. */
  watch(wanted: Wanted, ears: ItemEars): () => void;
  close(): void;
}

export class LiveSource implements Source {
  readonly recorded = false;
  private socket: LiveSocket | undefined;
  private readonly path: string;

  constructor(
    mission: string,
    private readonly token: string,
  ) {
    this.path = `v1/missions/${mission}/live`;
  }

  follow(ears: FlightEars): void {
    this.socket = new LiveSocket(`${this.path}?rate=10`, this.token, {
      text: (message) => {
        if (message["kind"] === "end") ears.end();
        if (message["kind"] === "mission") {
          ears.mission(message["mission"] as MissionOut, message["now"] as number);
        }
      },
      up: (connected) => ears.up(connected),
    });
  }

  watch({ camera, finders, depth }: Wanted, ears: ItemEars): () => void {
    const query = new URLSearchParams({ rate: "1", streams: [camera, ...finders].join(",") });
    if (depth) query.set("depth", camera);
    let socket: LiveSocket | undefined;
    let left = false;
    void wantedForm().then((form) => {
      if (left) return;
      query.set("pictures", form);
      socket = new LiveSocket(`${this.path}?${query}`, this.token, {
        text: (message) => message["kind"] === "item" && ears.found(message),
        blob: (message, data) => ears.picture(message, data),
        up: () => undefined,
      });
    });
    return () => {
      left = true;
      socket?.close();
    };
  }

  close(): void {
    this.socket?.close();
  }
}
