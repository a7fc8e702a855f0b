// A network in C++: ns-3's IEEE 802.15.4 radio and MAC (lr-wpan) decide who hears whom.  ns3-network [ADDRESS]
// Every robot broadcasts its payload once per period, in one data frame without acknowledgement. See README.md.
#include "cosim/v1/netsim.grpc.pb.h"

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <future>
#include <grpcpp/grpcpp.h>
#include <iostream>
#include <map>
#include <ns3/constant-position-mobility-model.h>
#include <ns3/core-module.h>
#include <ns3/lr-wpan-csmaca.h>
#include <ns3/lr-wpan-mac.h>
#include <ns3/lr-wpan-net-device.h>
#include <ns3/lr-wpan-phy.h>
#include <ns3/lr-wpan-spectrum-value-helper.h>
#include <ns3/node.h>
#include <ns3/propagation-delay-model.h>
#include <ns3/propagation-loss-model.h>
#include <ns3/single-model-spectrum-channel.h>
#include <openssl/evp.h>
#include <optional>
#include <set>
#include <sstream>
#include <toml++/toml.h>
#include <unordered_map>

using namespace cosim::v1;
using grpc::Status, grpc::StatusCode;

constexpr uint32_t MAX_AGENTS = 4096;     // positions, gains and short addresses are kept for each
constexpr uint32_t MAX_PAYLOAD_BYTES = 116;  // 127 of a PSDU, less 9 of header and 2 of checksum
constexpr int64_t SETTLE_NS = 1'000'000;  // a frame's outcome is reported this long after its end: 300 km at the speed of light

Status Invalid(const std::string& why) { return {StatusCode::INVALID_ARGUMENT, why}; }
Status NotNow(const std::string& why) { return {StatusCode::FAILED_PRECONDITION, why}; }

/// The section [netsim]. Powers in dBm, of everything else the unit is in the name.
struct Settings {
    std::string propagation = "log-distance";
    double tx_power_dbm = 0, noise_figure_db = 0, exponent = 3, reference_distance_m = 1, slot_s = 0.01;
    double reference_loss_db = NAN;        // not stated: free space over the reference distance
    double nakagami_m = 0;                 // 0: no fading
    int64_t channel = 18, min_be = 3, max_csma_backoffs = 4;
    bool propagation_delay = true;

    double FrequencyHz() const { return (2405.0 + 5.0 * (channel - 11)) * 1e6; }

    /// Reads the section and fills in `reference_loss_db`; returns every problem, or nothing.
    std::string Read(const std::string& text) {
        std::ostringstream problems;
        std::set<std::string> known = {"propagation", "propagation_delay", "url"};
        try {
            toml::table table = toml::parse(text);
            auto number = [&](const char* key, auto& value, double least, double most) {
                known.insert(key);
                if (!table.contains(key)) return;
                using Number = std::decay_t<decltype(value)>;
                std::optional<Number> stated = table[key].value<Number>();
                if (!stated || !(*stated >= least && *stated <= most))
                    problems << key << ": must be " << (std::is_integral_v<Number> ? "an integer" : "a number") << " from " << least << " to " << most << "; ";
                else value = *stated;
            };
            number("tx_power_dbm", tx_power_dbm, -100, 60);
            number("noise_figure_db", noise_figure_db, 0, 60);
            number("exponent", exponent, 1, 8);
            number("reference_distance_m", reference_distance_m, 0.001, 1e4);
            number("reference_loss_db", reference_loss_db, -100, 200);
            number("nakagami_m", nakagami_m, 0.5, 100);
            number("slot_s", slot_s, 0, 1000);
            number("channel", channel, 11, 26);
            number("min_be", min_be, 0, 8);
            number("max_csma_backoffs", max_csma_backoffs, 0, 5);
            propagation = table["propagation"].value_or(table.contains("propagation") ? std::string() : propagation);
            if (propagation != "log-distance" && propagation != "friis") problems << "propagation: must be \"log-distance\" or \"friis\"; ";
            if (table.contains("propagation_delay") && !table["propagation_delay"].is_boolean()) problems << "propagation_delay: must be true or false; ";
            propagation_delay = table["propagation_delay"].value_or(propagation_delay);
            for (auto&& [key, value] : table)
                if (!known.count(std::string(key.str()))) problems << key.str() << ": unknown key; see netsim/examples/ns3/README.md; ";
        } catch (const toml::parse_error& error) {
            problems << "config_toml: " << error.description() << "; ";
        }
        if (std::isnan(reference_loss_db)) reference_loss_db = 20 * std::log10(4 * M_PI * reference_distance_m * FrequencyHz() / 299792458.0);
        std::string all = problems.str();
        return all.substr(0, all.empty() ? 0 : all.size() - 2);
    }

    /// What is in force, as TOML.
    std::string Effective() const {
        toml::table table{{"propagation", propagation}, {"tx_power_dbm", tx_power_dbm}, {"noise_figure_db", noise_figure_db}, {"exponent", exponent},
                          {"reference_distance_m", reference_distance_m}, {"reference_loss_db", reference_loss_db}, {"slot_s", slot_s},
                          {"channel", channel}, {"min_be", min_be}, {"max_csma_backoffs", max_csma_backoffs}, {"propagation_delay", propagation_delay}};
        if (nakagami_m > 0) table.insert("nakagami_m", nakagami_m);
        return (std::ostringstream() << table << "\n").str();
    }
};

/// A frame from the moment its sender's MAC is given it until its outcome is known.
struct Frame {
    uint32_t sender;
    std::string payload;
    uint64_t sent_ns = 0, end_ns = 0;
    std::map<uint32_t, float> rssi_dbm;  // by receiver, of those that received it
};

/// Robots with an lr-wpan device each, on one channel. ns-3's simulator is global: there is one `Radio` at a time.
class Radio {
  public:
    std::vector<Frame> settled;  // since `Run` was called, in no order
    std::vector<double> sent, received, no_access;  // frames by robot, since the beginning

    Radio(const Settings& settings, uint32_t n, uint64_t seed) : sent(n), received(n), no_access(n), settings_(settings), loss_db_(n * size_t(n)) {
        ns3::RngSeedManager::SetSeed(1 + uint32_t((seed >> 32) % 4294944441u));
        ns3::RngSeedManager::SetRun(seed & 0xffffffff);
        channel_ = ns3::CreateObject<ns3::SingleModelSpectrumChannel>();
        ns3::Ptr<ns3::PropagationLossModel> loss;
        if (settings.propagation == "friis") {
            auto friis = ns3::CreateObject<ns3::FriisPropagationLossModel>();
            friis->SetFrequency(settings.FrequencyHz());
            loss = friis;
        } else {
            auto log_distance = ns3::CreateObject<ns3::LogDistancePropagationLossModel>();
            log_distance->SetPathLossExponent(settings.exponent);
            log_distance->SetReference(settings.reference_distance_m, settings.reference_loss_db);
            loss = log_distance;
        }
        channel_->AddPropagationLossModel(loss);
        if (settings.nakagami_m > 0) {
            auto fading = ns3::CreateObject<ns3::NakagamiPropagationLossModel>();
            for (const char* zone : {"m0", "m1", "m2"}) fading->SetAttribute(zone, ns3::DoubleValue(settings.nakagami_m));
            fading->AssignStreams(0);
            channel_->AddPropagationLossModel(fading);
        }
        if (settings.propagation_delay) channel_->SetPropagationDelayModel(ns3::CreateObject<ns3::ConstantSpeedPropagationDelayModel>());
        channel_->TraceConnectWithoutContext("PathLoss", ns3::MakeCallback(&Radio::OnPathLoss, this));
        for (uint32_t robot = 0; robot < n; ++robot) AddRobot(robot);
    }

    ~Radio() { ns3::Simulator::Destroy(); }

    void Move(uint32_t robot, double x_m, double y_m, double z_m) { places_[robot]->SetPosition({x_m, y_m, z_m}); }

    /// Gives the payload to the robot's MAC in the robot's slot of a period of this length.
    void Say(uint32_t robot, std::string payload, uint64_t period_ns) {
        uint64_t slot_ns = std::llround(settings_.slot_s * 1e9);
        uint64_t slots = slot_ns ? std::max<uint64_t>(1, period_ns / slot_ns) : 1;
        ns3::Simulator::Schedule(ns3::NanoSeconds(slot_ns * (robot % slots)), &Radio::Send, this, robot, std::move(payload));
    }

    void Run(uint64_t for_ns) {
        settled.clear();
        ns3::Simulator::Stop(ns3::NanoSeconds(for_ns));
        ns3::Simulator::Run();
    }

  private:
    void AddRobot(uint32_t robot) {
        auto node = ns3::CreateObject<ns3::Node>();
        auto place = ns3::CreateObject<ns3::ConstantPositionMobilityModel>();
        auto device = ns3::CreateObject<ns3::LrWpanNetDevice>();
        auto phy = device->GetPhy();
        node->AggregateObject(place);
        node->AddDevice(device);
        device->SetAddress(ShortAddress(robot + 1));
        phy->SetMobility(place);
        ns3::LrWpanPhyPibAttributes pib{};
        pib.phyCurrentChannel = settings_.channel;
        phy->PlmeSetAttributeRequest(ns3::phyCurrentChannel, &pib);
        ns3::LrWpanSpectrumValueHelper spectrum;
        phy->SetTxPowerSpectralDensity(spectrum.CreateTxPowerSpectralDensity(settings_.tx_power_dbm, settings_.channel));
        auto noise = spectrum.CreateNoisePowerSpectralDensity(settings_.channel);
        *noise *= std::pow(10.0, settings_.noise_figure_db / 10);
        phy->SetNoisePowerSpectralDensity(noise);
        device->SetChannel(channel_);
        device->GetCsmaCa()->SetMacMinBE(settings_.min_be);
        device->GetCsmaCa()->SetMacMaxBE(std::max<int64_t>(5, settings_.min_be));
        device->GetCsmaCa()->SetMacMaxCSMABackoffs(settings_.max_csma_backoffs);
        device->AssignStreams(100 + 10 * int64_t(robot));
        device->GetMac()->SetMcpsDataIndicationCallback(ns3::MakeBoundCallback(&Radio::OnReceived, this, robot));
        device->GetMac()->TraceConnectWithoutContext("MacTxDrop", ns3::MakeCallback(&Radio::OnDropped, this));
        phy->TraceConnectWithoutContext("PhyTxBegin", ns3::MakeCallback(&Radio::OnBegin, this));
        phy->TraceConnectWithoutContext("PhyTxEnd", ns3::MakeCallback(&Radio::OnEnd, this));
        places_.push_back(place);
        devices_.push_back(device);
        robots_[ns3::PeekPointer(phy)] = robot;
    }

    static ns3::Mac16Address ShortAddress(uint32_t number) {
        uint8_t bytes[2] = {uint8_t(number >> 8), uint8_t(number)};
        ns3::Mac16Address address;
        address.CopyFrom(bytes);
        return address;
    }

    void Send(uint32_t robot, std::string payload) {
        auto packet = ns3::Create<ns3::Packet>(reinterpret_cast<const uint8_t*>(payload.data()), payload.size());
        frames_[packet->GetUid()] = {robot, std::move(payload)};
        ns3::McpsDataRequestParams params;
        params.m_srcAddrMode = ns3::SHORT_ADDR;
        params.m_dstAddrMode = ns3::SHORT_ADDR;
        params.m_dstAddr = ns3::Mac16Address::GetBroadcast();
        params.m_dstPanId = devices_[robot]->GetMac()->GetPanId();
        devices_[robot]->GetMac()->McpsDataRequest(params, packet);
    }

    void OnBegin(ns3::Ptr<const ns3::Packet> packet) {
        Frame& frame = frames_.at(packet->GetUid());
        frame.sent_ns = ns3::Simulator::Now().GetNanoSeconds();
        ++sent[frame.sender];
    }

    void OnEnd(ns3::Ptr<const ns3::Packet> packet) {
        frames_.at(packet->GetUid()).end_ns = ns3::Simulator::Now().GetNanoSeconds();
        ns3::Simulator::Schedule(ns3::NanoSeconds(SETTLE_NS), &Radio::Settle, this, packet->GetUid());
    }

    void Settle(uint64_t uid) { settled.push_back(std::move(frames_.extract(uid).mapped())); }

    void OnDropped(ns3::Ptr<const ns3::Packet> packet) {
        auto frame = frames_.extract(packet->GetUid());
        if (frame) ++no_access[frame.mapped().sender];
    }

    void OnPathLoss(ns3::Ptr<const ns3::SpectrumPhy> from, ns3::Ptr<const ns3::SpectrumPhy> to, double loss_db) {
        loss_db_[robots_.at(ns3::PeekPointer(from)) * places_.size() + robots_.at(ns3::PeekPointer(to))] = loss_db;
    }

    static void OnReceived(Radio* self, uint32_t robot, ns3::McpsDataIndicationParams, ns3::Ptr<ns3::Packet> packet) {
        auto found = self->frames_.find(packet->GetUid());
        if (found == self->frames_.end()) return;  // from farther away than SETTLE_NS allows
        Frame& frame = found->second;
        frame.rssi_dbm[robot] = float(self->settings_.tx_power_dbm - self->loss_db_[frame.sender * self->places_.size() + robot]);
        ++self->received[robot];
    }

    Settings settings_;
    ns3::Ptr<ns3::SingleModelSpectrumChannel> channel_;
    std::vector<ns3::Ptr<ns3::ConstantPositionMobilityModel>> places_;
    std::vector<ns3::Ptr<ns3::LrWpanNetDevice>> devices_;
    std::unordered_map<const ns3::SpectrumPhy*, uint32_t> robots_;
    std::unordered_map<uint64_t, Frame> frames_;  // by ns-3's number of the packet
    std::vector<double> loss_db_;                 // of the latest frame, by sender and receiver
};

/// The byte string of the digest (common.proto), little-endian as this machine is.
template <typename Columns>
void Append(std::string& text, const Columns& columns) {
    text.append(reinterpret_cast<const char*>(columns.data()), columns.size() * sizeof(*columns.data()));
}

std::string Sha256(const std::string& text) {
    unsigned char digest[32];
    EVP_Digest(text.data(), text.size(), digest, nullptr, EVP_sha256(), nullptr);
    return {reinterpret_cast<char*>(digest), sizeof digest};
}

std::string AllAlive(uint32_t n) {
    std::string bits((n + 7) / 8, '\xff');
    if (n % 8) bits.back() = char((1 << n % 8) - 1);
    return bits;
}

/// One experiment after the other, as the contract has it. All calls come from one thread.
class Experiment {
  public:
    Status Configure(const NetSimServiceConfigureRequest& asked, NetSimServiceConfigureResponse* reply) {
        Settings settings;
        if (std::string problems = settings.Read(asked.config_toml()); !problems.empty()) return Invalid(problems);
        if (asked.agent_count() < 1) return Invalid("agent_count: must be at least 1, got 0");
        if (asked.agent_count() > MAX_AGENTS) return {StatusCode::RESOURCE_EXHAUSTED, "agent_count: at most " + std::to_string(MAX_AGENTS)};
        if (asked.coupling() == COUPLING_EVENT) return Invalid("coupling: sequential or parallel");
        n_ = asked.agent_count();
        wants_rssi_ = std::count(asked.columns().begin(), asked.columns().end(), DELIVERY_COLUMN_RSSI_DBM);
        bool wants_statistics = std::count(asked.records().begin(), asked.records().end(), NET_RECORD_STATISTICS);
        radio_.reset();  // before the next one: ns-3's simulator is global
        radio_ = std::make_unique<Radio>(settings, n_, asked.seed());
        asked_.Clear(), reply_.Clear(), digest_.clear(), delivered_.clear();
        step_ = time_ns_ = 0;
        reply->set_effective_config_toml(settings.Effective());
        reply->mutable_motes()->set_alive(AllAlive(n_));
        if (asked.site_toml().find_first_not_of(" \n\r\t") != std::string::npos) reply->add_warnings("walls and obstacles of [site] do not attenuate the radio of ns-3");
        if (wants_statistics) reply->add_records(NET_RECORD_STATISTICS), Statistics(reply->mutable_statistics());
        return Status::OK;
    }

    Status Step(const NetSimServiceStepRequest& asked, NetSimServiceStepResponse* reply) {
        if (!radio_) return NotNow("step: Configure comes first");
        if (step_ > 0 && asked.step() == step_) {
            if (asked.SerializeAsString() != asked_.SerializeAsString()) return NotNow("step " + std::to_string(step_) + " was taken with other content");
            *reply = reply_;
            return Status::OK;
        }
        if (asked.step() != step_ + 1) return NotNow("step " + std::to_string(asked.step()) + " cannot follow step " + std::to_string(step_));
        if (asked.until_ns() <= time_ns_) return NotNow("until_ns: must be later than " + std::to_string(time_ns_));
        if (!asked.confirmed_digest().empty() && asked.confirmed_digest() != digest_) return NotNow("confirmed_digest is not the digest of step " + std::to_string(step_));
        if (std::string problem = Problem(asked); !problem.empty()) return Invalid(problem);
        const AgentStates& states = asked.states();
        size_t begin = 0;
        for (uint32_t robot = 0; robot < n_; ++robot) {
            radio_->Move(robot, states.x_m(robot), states.y_m(robot), states.z_m(robot));
            uint32_t length = asked.payloads().length_bytes_size() ? asked.payloads().length_bytes(robot) : 0;
            if (length && Alive(states, robot)) radio_->Say(robot, asked.payloads().data().substr(begin, length), asked.until_ns() - time_ns_);
            begin += length;
        }
        radio_->Run(asked.until_ns() - time_ns_);

        reply_.Clear();
        asked_ = asked;
        step_ = asked.step(), time_ns_ = asked.until_ns();
        Deliver(states, reply_.mutable_deliveries());
        // The digest has the deliveries that the robots were given in this step: those of the period before.
        std::string text;
        Append(text, std::array<uint64_t, 2>{step_, time_ns_});
        text += states.alive();
        Append(text, states.x_m()), Append(text, states.y_m()), Append(text, states.z_m());
        digest_ = Sha256(text + delivered_);
        delivered_ = Covered(reply_.deliveries());
        reply_.set_step(step_), reply_.set_time_ns(time_ns_), reply_.set_digest(digest_);
        reply_.mutable_motes()->set_alive(AllAlive(n_));
        if (std::count(asked.records().begin(), asked.records().end(), NET_RECORD_STATISTICS)) Statistics(reply_.mutable_statistics());
        *reply = reply_;
        return Status::OK;
    }

    Status Barrier(NetSimServiceBarrierResponse* reply) const {
        if (step_ == 0) return NotNow("step: none was taken yet");
        reply->set_step(step_), reply->set_time_ns(time_ns_), reply->set_digest(digest_);
        return Status::OK;
    }

  private:
    static bool Alive(const AgentStates& states, uint32_t robot) { return states.alive()[robot / 8] >> robot % 8 & 1; }

    /// What is wrong with the contents of a step, or nothing.
    std::string Problem(const NetSimServiceStepRequest& asked) const {
        const AgentStates& states = asked.states();
        if (states.alive().size() != (n_ + 7) / 8) return "states.alive: must have " + std::to_string((n_ + 7) / 8) + " bytes";
        for (const auto* column : {&states.x_m(), &states.y_m(), &states.z_m()}) {
            if (column->size() != int(n_)) return "states: x_m, y_m and z_m must have " + std::to_string(n_) + " entries each";
            for (double value : *column)
                if (!(std::abs(value) <= 1e12)) return "states: positions must be finite and at most 1e12 m";
        }
        const auto& lengths = asked.payloads().length_bytes();
        if (lengths.size() != 0 && lengths.size() != int(n_)) return "payloads.length_bytes: must have " + std::to_string(n_) + " entries";
        uint64_t total = 0;
        for (uint32_t length : lengths) {
            if (length > MAX_PAYLOAD_BYTES) return "payloads.length_bytes: a frame carries at most " + std::to_string(MAX_PAYLOAD_BYTES) + " bytes, got " + std::to_string(length);
            total += length;
        }
        if (total != asked.payloads().data().size()) return "payloads.data: must have " + std::to_string(total) + " bytes, as length_bytes says";
        if (asked.commands_size()) return "commands: none is announced";
        return asked.stop_at_first_delivery() ? "stop_at_first_delivery: not announced" : "";
    }

    /// The frames whose outcome became known, and who of the robots that exist received which.
    void Deliver(const AgentStates& states, Deliveries* out) {
        auto& frames = radio_->settled;
        std::sort(frames.begin(), frames.end(), [](const Frame& a, const Frame& b) { return std::tie(a.sent_ns, a.sender) < std::tie(b.sent_ns, b.sender); });
        for (const Frame& frame : frames) {
            Transmissions* air = out->mutable_transmissions();
            air->add_sender(frame.sender), air->add_sent_ns(frame.sent_ns), air->add_end_ns(frame.end_ns);
            air->mutable_payloads()->add_length_bytes(frame.payload.size());
            air->mutable_payloads()->mutable_data()->append(frame.payload);
        }
        for (uint32_t robot = 0; robot < n_ && !frames.empty(); ++robot) {
            for (uint32_t index = 0; index < frames.size(); ++index)
                if (auto heard = frames[index].rssi_dbm.find(robot); heard != frames[index].rssi_dbm.end() && Alive(states, robot)) {
                    out->add_heard(index);
                    if (wants_rssi_) out->add_rssi_dbm(heard->second);
                }
            out->add_heard_end(out->heard_size());
        }
    }

    static std::string Covered(const Deliveries& given) {
        std::string text;
        const Transmissions& air = given.transmissions();
        Append(text, air.sender()), Append(text, air.sent_ns()), Append(text, air.end_ns()), Append(text, air.payloads().length_bytes());
        text += air.payloads().data();
        Append(text, given.heard_end()), Append(text, given.heard());
        return text;
    }

    void Statistics(MoteStatistics* out) const {
        auto add = [out](const char* name, const std::vector<double>& values) {
            Statistic* column = out->add_columns();
            column->set_name(name), column->set_unit("frames"), column->mutable_values()->Add(values.begin(), values.end());
        };
        add("tx_frames", radio_->sent), add("rx_frames", radio_->received), add("drops_channel_access", radio_->no_access);
    }

    std::unique_ptr<Radio> radio_;  // none: not configured
    uint32_t n_ = 0;
    uint64_t step_ = 0, time_ns_ = 0;
    bool wants_rssi_ = false;
    NetSimServiceStepRequest asked_;
    NetSimServiceStepResponse reply_;
    std::string digest_, delivered_;  // of the latest step; what the next digest has of its deliveries
};

/// Serves the contract. gRPC has many threads and ns-3 runs on one: calls queue for it, except `Describe`.
class Service final : public NetSimService::Service {
  public:
    Status Describe(grpc::ServerContext*, const NetSimServiceDescribeRequest*, NetSimServiceDescribeResponse* reply) override {
        reply->set_name("ns3-network"), reply->set_version("1"), reply->set_contract_version(1);
        reply->mutable_limits()->set_max_agents(MAX_AGENTS);
        reply->set_session(true), reply->set_parallel(true);
        reply->add_columns(DELIVERY_COLUMN_RSSI_DBM), reply->add_records(NET_RECORD_STATISTICS);
        return Status::OK;
    }
    Status Configure(grpc::ServerContext*, const NetSimServiceConfigureRequest* asked, NetSimServiceConfigureResponse* reply) override {
        return Call([&] { return experiment_.Configure(*asked, reply); });
    }
    Status Step(grpc::ServerContext*, const NetSimServiceStepRequest* asked, NetSimServiceStepResponse* reply) override {
        return Call([&] { return experiment_.Step(*asked, reply); });
    }
    Status Barrier(grpc::ServerContext*, const NetSimServiceBarrierRequest*, NetSimServiceBarrierResponse* reply) override {
        return Call([&] { return experiment_.Barrier(reply); });
    }
    Status Session(grpc::ServerContext*, grpc::ServerReaderWriter<NetSimServiceSessionResponse, NetSimServiceSessionRequest>* stream) override {
        NetSimServiceSessionRequest asked;
        while (stream->Read(&asked)) {
            NetSimServiceSessionResponse reply;
            Status status = Invalid("request: either step or barrier");
            if (asked.has_step()) status = Call([&] { return experiment_.Step(asked.step(), reply.mutable_step()); });
            if (asked.has_barrier()) status = Call([&] { return experiment_.Barrier(reply.mutable_barrier()); });
            if (!status.ok()) return status;
            stream->Write(reply);
        }
        return Status::OK;
    }

    /// Does what is asked, one call after the other, for ever.
    [[noreturn]] void Work() {
        for (;;) {
            std::unique_lock lock(mutex_);
            asked_.wait(lock, [this] { return !queue_.empty(); });
            std::packaged_task<Status()> next = std::move(queue_.front());
            queue_.pop_front();
            lock.unlock();
            next();
        }
    }

  private:
    Status Call(std::function<Status()> work) {
        std::packaged_task<Status()> task(std::move(work));
        std::future<Status> result = task.get_future();
        {
            std::lock_guard lock(mutex_);
            queue_.push_back(std::move(task));
        }
        asked_.notify_one();
        return result.get();
    }

    Experiment experiment_;
    std::mutex mutex_;
    std::condition_variable asked_;
    std::deque<std::packaged_task<Status()>> queue_;
};

int main(int argc, char** argv) {
    const char* listen = std::getenv("MURMURATION_LISTEN");
    std::string address = argc > 1 ? argv[1] : listen && *listen ? listen : "127.0.0.1:0";
    bool is_unix = address.rfind("unix:", 0) == 0;
    std::string host = address.substr(0, address.rfind(':'));
    if (!is_unix && host != "127.0.0.1" && host != "localhost" && host != "[::1]") {
        std::cerr << "address must be of this machine, 127.0.0.1:PORT, [::1]:PORT or unix:PATH, got " << address << std::endl;
        return 1;
    }
    Service service;
    int port = 0;
    grpc::ServerBuilder builder;
    builder.SetMaxReceiveMessageSize(1 << 28);
    builder.AddListeningPort(address, grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(&service);
    std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
    if (!server) {
        std::cerr << "cannot listen on " << address << std::endl;
        return 1;
    }
    std::cout << "listening on " << (is_unix ? address : host + ":" + std::to_string(port)) << std::endl;
    service.Work();
}
