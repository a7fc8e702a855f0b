import { fromBinary, toBinary } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { type ControlKind, ControlSchema, type Overview, OverviewSchema, type Runs, RunsSchema } from "../gen/murmuration/view/v1/view_pb.ts";

/** Requests to the program that serves the page. Each carries the token of the page's own address. */
export class Api {
  private readonly token: string;

  constructor(token: string) {
    this.token = token;
  }

  async runs(): Promise<Runs> {
    return fromBinary(RunsSchema, await this.bytes("api/runs"));
  }

  async overview(run: number): Promise<Overview> {
    return fromBinary(OverviewSchema, await this.bytes(`api/runs/${run}/overview`));
  }

  /** An encoded `Frames`. */
  frames(run: number, fromNs: number, untilNs: number, most: number, signal: AbortSignal): Promise<Uint8Array> {
    const query = `from_ns=${Math.round(fromNs)}&until_ns=${Math.round(untilNs)}&most=${most}`;
    return this.bytes(`api/runs/${run}/frames?${query}`, signal);
  }

  /** The endless response of `/api/live`. */
  async live(): Promise<ReadableStream<Uint8Array>> {
    const response = await this.request("api/live", {});
    if (response.body === null) throw new Error("the live stream is empty: reload the page");
    return response.body;
  }

  async control(kind: ControlKind): Promise<void> {
    const body = new Uint8Array(toBinary(ControlSchema, create(ControlSchema, { kind })));
    await this.request("api/control", { method: "POST", body, headers: { "Content-Type": "application/octet-stream" } });
  }

  private async bytes(path: string, signal?: AbortSignal): Promise<Uint8Array> {
    const response = await this.request(path, { signal });
    return new Uint8Array(await response.arrayBuffer());
  }

  private async request(path: string, init: RequestInit): Promise<Response> {
    let response: Response;
    const headers = { ...init.headers, Authorization: `Bearer ${this.token}` };
    try {
      response = await fetch(path, { ...init, headers, cache: "no-store" });
    } catch (cause) {
      if (cause instanceof DOMException && cause.name === "AbortError") throw cause;
      throw new Error("The program that serves this page does not answer. Check that it still runs, then reload the page.");
    }
    if (response.ok) return response;
    if (response.status === 401) throw new Error("This page needs the address that the program printed, with its token.");
    const text = (await response.text()).trim();
    throw new Error(text === "" ? `The program answered with status ${response.status}. Reload the page.` : text);
  }
}
