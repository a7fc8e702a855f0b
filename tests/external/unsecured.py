"""Secured frames of a capture made legible with AES of OpenSSL: CCM* as annex B of IEEE Std 802.15.4-2015 has it."""

import ctypes
import ctypes.util
import struct

from dissection import K1, K2

MIC_BYTES = 4
# The key join_key of [netsim.security].
JOIN_KEY = b"Murmuration join"
SECURED, ELEMENTS = 1 << 3, 1 << 9
SHORT, EXTENDED = 2, 3
# Header information elements that end their list (7.4.1).
TERMINATIONS = (0x7E, 0x7F)
KEYS = {1: bytes.fromhex(K1), 2: bytes.fromhex(K2)}
# Security control (9.4.1): key identifier mode 1, frame counter suppressed, ASN in the nonce; level by index of the key.
CONTROLS = {1: 0b0110_1001, 2: 0b0110_1101}

CRYPTO = ctypes.CDLL(ctypes.util.find_library("crypto"))
for name in ("EVP_CIPHER_CTX_new", "EVP_aes_128_cbc", "EVP_aes_128_ctr"):
    getattr(CRYPTO, name).restype = ctypes.c_void_p


def aes(cipher, key, iv, octets):
    """Encrypts octets, a multiple of 16 for CBC."""
    context = ctypes.c_void_p(CRYPTO.EVP_CIPHER_CTX_new())
    out, length = ctypes.create_string_buffer(len(octets) + 16), ctypes.c_int()
    assert CRYPTO.EVP_EncryptInit_ex(context, ctypes.c_void_p(cipher()), None, key, iv) == 1
    assert CRYPTO.EVP_EncryptUpdate(context, out, ctypes.byref(length), octets, len(octets)) == 1
    CRYPTO.EVP_CIPHER_CTX_free(context)
    return out.raw[: length.value]


def padded(octets):
    return octets + bytes(-len(octets) % 16)


def unseal(key, nonce, header, private, mic):
    """The plaintext of `private`, and whether `mic` is that of `header` and it."""
    # Counters begin with the flags L - 1 and the nonce; block 0 encrypts the MIC.
    stream = aes(CRYPTO.EVP_aes_128_ctr, key, b"\x01" + nonce + b"\0\0", bytes(16) + private)
    tag_pad, plain = stream[:MIC_BYTES], stream[16:]
    flags = 0b0100_0000 | (MIC_BYTES - 2) // 2 << 3 | 1
    begin = bytes([flags]) + nonce + struct.pack(">H", len(plain))
    summed = begin + padded(struct.pack(">H", len(header)) + header) + padded(plain)
    tag = aes(CRYPTO.EVP_aes_128_cbc, key, bytes(16), summed)[-16:][:MIC_BYTES]
    return plain, bytes(a ^ b for a, b in zip(tag, tag_pad)) == mic


def oscore_contexts(motes):
    """Options for tshark: the OSCORE contexts of pledges towards the registrar (RFC 9031, section 7.3)."""
    words = []
    for mote in motes:
        address = (0x02 << 56 | mote).to_bytes(8, "big")
        shared = aes(CRYPTO.EVP_aes_128_cbc, JOIN_KEY, bytes(16), address + bytes(8))
        sender, registrar = "", b"JRC".hex()
        context = (sender, registrar, shared.hex(), "", address.hex(), "AES-CCM-16-64-128 (CCM*)")
        words += ["-o", "uat:oscore_contexts:" + ",".join(f'"{word}"' for word in context)]
    return words


class Secured:
    """A record of a capture. `legible`: the same without auxiliary security header and MIC. `is_right`: the MIC is."""

    def __init__(self, record, sent):
        """`sent`: by slot, sender and sequence number, whom frames were for: acknowledgments do not name their sender."""
        fields_end = 16 + int.from_bytes(record[18:20], "little")
        psdu = record[fields_end:-2]
        control = int.from_bytes(psdu[:2], "little")
        asn = asn_of(record[20:fields_end])
        at = 5
        is_long = control >> 10 & 3 == EXTENDED
        destination = psdu[at : at + 8][::-1] if is_long else None
        at += 8 if is_long else 2
        source = psdu[at : at + 8][::-1] if control >> 14 & 3 == EXTENDED else None
        at += 8 if source else 0
        if source:
            sent[asn, source, psdu[2]] = destination
        else:
            source = sent.get((asn, destination, psdu[2]))
        self.legible, self.index, self.is_right = record, None, True
        if not control & SECURED:
            return
        self.index = psdu[at + 1]
        header_end = at + 2
        while control & ELEMENTS and header_end < len(psdu) - MIC_BYTES:
            descriptor = int.from_bytes(psdu[header_end : header_end + 2], "little")
            header_end += 2 + (descriptor & 0x7F)
            if descriptor >> 7 & 0xFF in TERMINATIONS:
                break
        if self.index == 1:
            # Authenticated only.
            header_end = len(psdu) - MIC_BYTES
        nonce = (source or bytes(8)) + asn.to_bytes(5, "big")
        private, mic = psdu[header_end:-MIC_BYTES], psdu[-MIC_BYTES:]
        plain, self.is_right = unseal(KEYS[self.index], nonce, psdu[:header_end], private, mic)
        self.is_right &= psdu[at] == CONTROLS[self.index]
        plain = struct.pack("<H", control & ~SECURED) + psdu[2:at] + psdu[at + 2 : header_end] + plain
        self.legible = record[:fields_end] + plain + record[-2:]


def asn_of(fields):
    """The absolute slot number among the fields of a record (IEEE 802.15.4 TAP)."""
    at = 0
    while at < len(fields):
        kind, length = struct.unpack_from("<HH", fields, at)
        if kind == 7:
            return struct.unpack_from("<Q", fields, at + 4)[0]
        at += 4 + (length + 3) // 4 * 4
    raise AssertionError("a record without a slot number")
