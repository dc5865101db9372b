"""What asyncua 2.1 lacks as a server, mended in this one place; each module says what and why.

asyncua keeps what it does well: the types and the binary codec, the cryptography of secure channels, the
standard address space, the import of NodeSet2 files. Its classes are used as they are and none is patched,
but for the decoder of null arrays (`codec.bound_null_arrays`). Its service layer - connections, sessions,
subscriptions, reads, calls, history - is not used at all; these modules take its place.

==================  =================================================================================
`codec`             lengths that are negative or bound nothing; one exception for what cannot be read
`connection`        malformed Hello, half-open connections, oversized messages, clients that do not read
`channel`           trust checked before a channel opens; renewal; limits
`sessions`          tokens that cannot be guessed, bound to their channel; limits; timeouts
`access`            no session without encryption; certificates and signatures compared
`dispatch`          every fault of a request becomes the status code of the standard
`attributes`        index ranges, encodings, timestamps, the reader's own rights
`views`             continuation points, masks, reference types that exist
`calls`             arguments checked, callers known, methods bound to their objects
`changes`           deadbands, NaN, index ranges of monitored items
`items`             queues that tell of overflow
`subscriptions`     retransmission, lifetime, late publishing, MoreNotifications
`monitored`         items that exist, with the filters they can have
`monitoring`        Republish, TransferSubscriptions, subscriptions that belong to their session
`eventfilter`       OfType with subtypes, three-valued where clauses
`histories`         rights, events; with `spans` time bounds and continuation, `processed` aggregates
`wire`              values encoded once for all subscribers
==================  =================================================================================
"""
